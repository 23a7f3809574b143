"""python-ins' feedback filter as an algorithm under test; needs `pip install python-ins`.

The filter takes a whole flight at once, but goes through it from its beginning to its end: what it
says of a moment stands on what came before. It models no latency: fixes are given their moments
with the one that the greeting names.
"""
import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # flights share the cores

import numpy
import pandas
from pyins.filters import run_feedback_filter
from pyins.inertial_sensor import EstimationModel
from pyins.measurements import NedVelocity, Position

LLA, NED, RPH = ["lat", "lon", "alt"], ["VN", "VE", "VD"], ["roll", "pitch", "heading"]
DELTA = ["dt", "theta_x", "theta_y", "theta_z", "dv_x", "dv_y", "dv_z"]
# A step of the covariance costs milliseconds, and its error model holds no specific force.
STEP_S = 1.0


def read():
    """All lines until the end, by their first word; the greeting is answered at once."""
    lines = {}
    for line in sys.stdin:
        kind, *fields = line.strip().split(",")
        if kind == "end":
            break
        keep = [fields[0]] if kind == "ask" else [float(f) if f else numpy.nan for f in fields]
        lines.setdefault(kind, []).append(keep)
        if kind == "start":
            print("ready,1,after", flush=True)
    return lines


def filtered(lines):
    t, *pva = lines["start"][0][:10]
    position_sd, velocity_sd, level_sd, heading_sd = lines["start"][0][10:]
    gyro_noise, gyro_bias, gyro_walk, accel_noise, accel_bias, accel_walk = lines["unit"][0][:6]
    velocity_sigma, position_sigma, height_sigma, latency = lines["unit"][0][6:]
    imu = numpy.array(lines["imu"])
    increments = pandas.DataFrame(imu[:, 1:], index=imu[:, 0], columns=DELTA)
    gnss = numpy.array(lines["gnss"])
    fixes = pandas.DataFrame(gnss[:, 1:], index=gnss[:, 0] - latency, columns=LLA + NED)
    level = position_sigma, position_sigma, height_sigma
    return run_feedback_filter(
        pandas.Series(pva, index=LLA + NED + RPH, name=t),
        position_sd,
        velocity_sd,
        level_sd,
        heading_sd,
        increments,
        EstimationModel(gyro_bias, gyro_noise, gyro_walk),
        EstimationModel(accel_bias, accel_noise, accel_walk),
        [
            NedVelocity(fixes[NED].dropna(), velocity_sigma),
            Position(fixes[LLA].dropna(), numpy.array(level)),
        ],
        time_step=STEP_S,
    ).trajectory


def main():
    lines = read()
    trajectory = filtered(lines)
    for (asked,) in lines["ask"]:
        before = trajectory.index.searchsorted(float(asked) + 1e-6) - 1
        print("solution", asked, *trajectory[LLA + NED + RPH].iloc[before], sep=",", flush=True)


if __name__ == "__main__":
    main()
