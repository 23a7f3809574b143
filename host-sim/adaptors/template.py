"""An algorithm under test for `host-sim rehearse --with`: docs/rehearse.md has the lines.

Dead reckoning: it goes on from the last fix with its velocity, level and along the track. Put your
own filter in its place.
"""
import math
import sys

EARTH_RADIUS_M = 6_371_000.0


class Filter:
    def start(self, t, lat, lon, h, vn, ve, vd, roll, pitch, heading, *sigmas):
        self.t, self.position, self.velocity = t, [lat, lon, h], [vn, ve, vd]

    def imu(self, t, dt, theta, dv):
        """Turned by theta (rad) and pushed by dv (m/s), forward-right-down, over dt to t."""
        lat, lon, h = self.position
        vn, ve, vd = self.velocity
        degrees = math.degrees(dt / EARTH_RADIUS_M)
        east = degrees / math.cos(math.radians(lat))
        self.position = [lat + vn * degrees, lon + ve * east, h - vd * dt]
        self.t = t

    def gnss(self, t, lat, lon, h, vn, ve, vd):
        """What the fix does not have is None."""
        if lat is not None and h is not None:
            self.position = [lat, lon, h]
        if vn is not None:
            self.velocity = [vn, ve, vd or 0.0]

    def solution(self):
        """Position, velocity north-east-down, roll, pitch, heading; None while there is none."""
        heading = math.degrees(math.atan2(self.velocity[1], self.velocity[0]))
        return [*self.position, *self.velocity, 0.0, 0.0, heading]


def main():
    filter = Filter()
    for line in sys.stdin:
        kind, *fields = line.rstrip("\n").split(",")
        numbers = [float(field) if field else None for field in fields]
        if kind == "start":
            filter.start(*numbers)
            print("ready,1", flush=True)
        elif kind == "imu":
            filter.imu(numbers[0], numbers[1], numbers[2:5], numbers[5:8])
        elif kind == "gnss":
            filter.gnss(*numbers)
        elif kind == "ask":
            found = filter.solution()
            answer = ["none"] if found is None else ["solution"]
            print(*answer, fields[0], *(found or []), sep=",", flush=True)
        elif kind == "end":
            break


if __name__ == "__main__":
    main()
