#!/usr/bin/env python3
"""python-ins' extended Kalman filter over a log, as JSON.

usage: reference.py LOG START

LOG is a log folder with body axes FRD and increments. START is JSON: where the filter begins and
what it is told of the sensors, SI units and radians, names as in tests/src/pyins.rs. What is
printed is in the same axes as START, ENU and right-forward-up; python-ins' own are NED and FRD.
"""
import json
import sys
from pathlib import Path

import numpy
import pandas
from pyins.filters import run_feedback_filter
from pyins.inertial_sensor import EstimationModel
from pyins.measurements import NedVelocity, Position
from pyins.strapdown import compute_increments_from_imu

LLA = ["lat", "lon", "alt"]
NED = ["VN", "VE", "VD"]
RPH = ["roll", "pitch", "heading"]
# Each step of the covariance costs some 40 ms. Its error model holds no specific force, and its
# transition is exact: steps may be long.
STEP_S = 1.0


def swapped(vector):
    """From ENU to NED or from right-forward-up to FRD, and back."""
    x, y, z = vector
    return numpy.array([y, x, -z])


def geodetic(latitude_rad, longitude_rad, height_m):
    return [numpy.degrees(latitude_rad), numpy.degrees(longitude_rad), height_m]


def initial_pva(start):
    state = start["state"]
    values = [
        *geodetic(*state["position"]),
        *swapped(state["velocity_enu_mps"]),
        *numpy.degrees(state["roll_pitch_heading_rad"]),
    ]
    return pandas.Series(values, index=LLA + NED + RPH, name=start["time_s"])


def increments(folder, start):
    imu = pandas.read_csv(folder / "imu.csv", index_col="t_s")
    # The reading at the start is the one before the first increment.
    result = compute_increments_from_imu(imu.loc[start["time_s"] :], "increment")
    # The filter's own estimates of the biases begin at zero.
    for columns, bias in (("theta", "gyro_bias_radps"), ("dv", "accel_bias_mps2")):
        for axis, value in zip("xyz", swapped(start["state"][bias])):
            result[f"{columns}_{axis}"] -= value * result["dt"]
    return result


def measurements(folder, noise):
    gnss = pandas.read_csv(folder / "gnss.csv", index_col="t_s")
    velocity = pandas.DataFrame({"VN": gnss.vn, "VE": gnss.ve, "VD": -gnss.vu})
    position = pandas.DataFrame({"lat": gnss.lat_deg, "lon": gnss.lon_deg, "alt": gnss.h_m})
    return [
        NedVelocity(velocity, noise["velocity_sigma_mps"]),
        Position(position, noise["position_sigma_m"]),
    ]


def filtered(folder, start):
    noise, sigma = start["noise"], start["sigma"]
    return run_feedback_filter(
        initial_pva(start),
        sigma["position_m"],
        sigma["velocity_mps"],
        numpy.degrees(sigma["level_rad"]),
        numpy.degrees(sigma["heading_rad"]),
        increments(folder, start),
        EstimationModel(
            swapped(sigma["gyro_bias_radps"]) * [1, 1, -1],
            noise["gyro_noise"],
            noise["gyro_bias_walk"],
        ),
        EstimationModel(
            sigma["accel_bias_mps2"], noise["accel_noise"], noise["accel_bias_walk"]
        ),
        measurements(folder, noise),
        time_step=STEP_S,
    )


def row(result, start, time_s):
    trajectory = result.trajectory.loc[time_s]
    latitude_deg, longitude_deg, height_m = trajectory[LLA]
    bias = {"gyro": start["state"]["gyro_bias_radps"], "accel": start["state"]["accel_bias_mps2"]}
    north, east, down, *others = result.trajectory_sd.loc[time_s]
    v_north, v_east, v_down, *angles = others
    sigma = [east, north, down, v_east, v_north, v_down, *numpy.radians(angles)]
    for sd in (result.accel_sd, result.gyro_sd):
        sigma += list(abs(swapped(sd.loc[time_s])))
    return {
        "time_s": time_s,
        "state": {
            "position": [*numpy.radians([latitude_deg, longitude_deg]), height_m],
            "velocity_enu_mps": list(swapped(trajectory[NED])),
            "roll_pitch_heading_rad": list(numpy.radians(trajectory[RPH])),
            "accel_bias_mps2": list(bias["accel"] + swapped(result.accel.loc[time_s])),
            "gyro_bias_radps": list(bias["gyro"] + swapped(result.gyro.loc[time_s])),
        },
        "sigma": sigma,
    }


def main():
    folder, start = Path(sys.argv[1]), json.loads(sys.argv[2])
    result = filtered(folder, start)
    json.dump([row(result, start, time_s) for time_s in start["times_s"]], sys.stdout, indent=1)


if __name__ == "__main__":
    main()
