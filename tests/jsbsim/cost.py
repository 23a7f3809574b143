#!/usr/bin/env python3
"""Seconds that JSBSim's c172x takes per 100 Hz step, alone, as one number on stdout."""
import os
import time

import jsbsim

STEPS = 30_000


def main():
    # JSBSim greets on stdout: out of the way of the answer.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.set_debug_level(0)
    fdm.load_model("c172x")
    fdm.set_dt(0.01)
    fdm["ic/h-sl-ft"] = 4000
    fdm["ic/vc-kts"] = 100
    fdm.run_ic()
    fdm["propulsion/set-running"] = -1
    for _ in range(1000):
        fdm.run()
    start = time.perf_counter()
    for _ in range(STEPS):
        fdm.run()
    print((time.perf_counter() - start) / STEPS, file=answer)


if __name__ == "__main__":
    main()
