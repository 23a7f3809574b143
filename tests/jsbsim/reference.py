#!/usr/bin/env python3
"""Trim and modes of JSBSim's Cessna 172, as JSON.

usage: reference.py HEIGHT_M MASS_KG AIRSPEED_MPS...

JSBSim trims and linearises itself (FGLinearization); here only its matrix is cut into the
longitudinal and the lateral half and its eigenvalues are taken.
"""
import json
import math
import os
import sys

import jsbsim
import numpy

MODEL = "c172p"
FEET = 0.3048
KNOT = 1852 / 3600
POUND_FORCE = 4.4482216152605
POUND = 0.45359237
SLUG_FOOT_2 = 1.3558179483


def trimmed(height_m, mass_kg, airspeed_mps):
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.set_debug_level(0)
    fdm.load_model(MODEL)
    # Back seats empty, half tanks, and the two in front as heavy as it takes.
    for tank in (0, 1):
        fdm[f"propulsion/tank[{tank}]/contents-lbs"] = 100.0
    fdm["ic/h-sl-ft"] = height_m / FEET
    fdm["ic/vt-kts"] = airspeed_mps / KNOT
    fdm["ic/gamma-deg"] = 0.0
    fdm["fcs/mixture-cmd-norm"] = 0.87
    fdm["propulsion/magneto_cmd"] = 3
    fdm.run_ic()
    front_seats = [f"inertia/pointmass-weight-lbs[{seat}]" for seat in (0, 1)]
    each_lb = (mass_kg / POUND - fdm["inertia/weight-lbs"] + sum(fdm[s] for s in front_seats)) / 2
    for seat in front_seats:
        fdm[seat] = each_lb
    fdm["propulsion/set-running"] = -1
    fdm.run_ic()
    fdm["simulation/do_simple_trim"] = 1
    return fdm


def oscillation(root):
    frequency = abs(root)
    return {
        "natural_frequency_radps": frequency,
        "damping_ratio": -root.real / frequency,
        "period_s": 2 * math.pi / root.imag,
    }


def modes(fdm):
    linear = jsbsim.FGLinearization(fdm)
    names = list(linear.x_names)
    matrix = numpy.array(linear.system_matrix)

    def roots(states):
        rows = [names.index(state) for state in states]
        return numpy.linalg.eigvals(matrix[numpy.ix_(rows, rows)])

    engine = [name for name in names if name.lower().startswith("rpm")]
    pairs = sorted(
        (root for root in roots(["Vt", "Alpha", "Theta", "Q", *engine]) if root.imag > 1e-6),
        key=abs,
    )
    lateral = roots(["Beta", "Phi", "P", "R"])
    real = sorted(root.real for root in lateral if abs(root.imag) < 1e-6)
    return {
        "phugoid": oscillation(pairs[0]),
        "short_period": oscillation(pairs[-1]),
        "dutch_roll": oscillation(max(lateral, key=lambda root: root.imag)),
        "roll_time_constant_s": -1 / real[0],
        "spiral_time_constant_s": -1 / real[-1],
    }


def row(height_m, mass_kg, airspeed_mps):
    fdm = trimmed(height_m, mass_kg, airspeed_mps)
    return {
        "airspeed_mps": fdm["velocities/vt-fps"] * FEET,
        "mass_kg": fdm["inertia/weight-lbs"] * POUND,
        "alpha_deg": fdm["aero/alpha-deg"],
        "elevator_deg": math.degrees(fdm["fcs/elevator-pos-rad"]),
        "shaft_power_kw": fdm["propulsion/engine/power-hp"] * 0.745699872,
        "thrust_n": fdm["propulsion/engine/thrust-lbs"] * POUND_FORCE,
        "engine_rpm": fdm["propulsion/engine/engine-rpm"],
        "roll_inertia_kgm2": fdm["inertia/ixx-slugs_ft2"] * SLUG_FOOT_2,
        "pitch_inertia_kgm2": fdm["inertia/iyy-slugs_ft2"] * SLUG_FOOT_2,
        "yaw_inertia_kgm2": fdm["inertia/izz-slugs_ft2"] * SLUG_FOOT_2,
        "modes": modes(fdm),
    }


def main():
    height_m, mass_kg, *airspeeds = map(float, sys.argv[1:])
    # JSBSim greets on stdout: out of the way of the answer.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    rows = [row(height_m, mass_kg, airspeed) for airspeed in airspeeds]
    json.dump({"version": jsbsim.__version__, "model": MODEL, "rows": rows}, answer, indent=1)


if __name__ == "__main__":
    main()
