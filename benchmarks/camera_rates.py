"""One robot, one answer: three things hidden in a two-wheeled robot, under cameras of several rates.

A left wheel 4 % too large, motion capture 80 ms late, and a drive that lags by 60 ms; three training runs of 30 s and
two unseen ones, encoders at 50 Hz. Without the logged command the lag cannot be seen, and the other two must be named.
The error is dead reckoning of the unseen runs by plain arithmetic (gap_yardstick.py), with the sizes of the answer.

    python benchmarks/camera_rates.py [--json] [--quick] [--tiny] [--seed SEED]
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from _runs import options, print_json, print_table
from gap_yardstick import laid_on, reckoned

import drake_ispace as di

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from hidden import two_wheels

RATES_HZ = (5.0, 10.0, 30.0, 60.0)
ROBOT = {"wheels": 2, "radius_m": two_wheels.RADIUS_M, "arm_m": two_wheels.HALF_TRACK_M}


def answered(seed, seconds, rate_hz, has_command, library=None, training=3, unseen=2, **hidden):
    """What explain says of the robot at a rate of the camera, and what is left of it by plain arithmetic.

    library: effects to choose from, default all. training, unseen: numbers of runs. hidden: other sizes of what is
    hidden, as `two_wheels.drive` takes them.
    """
    runs = [two_wheels.drive(10 * seed + i, seconds, camera_hz=rate_hz, **hidden) for i in range(training + unseen)]
    if not has_command:
        runs = [
            replace(run, channels={name: c for name, c in run.channels.items() if name != "command"}) for run in runs
        ]
    answer = di.explain(two_wheels.model(), runs[:training], runs[training:], library)
    effects = {e.name: {p: value.estimate for p, value in e.parameters.items()} for e in answer.effects}
    errors = []
    for sizes in ({}, effects):
        squares = []
        for run in runs[training:]:
            kinect = run.channels["kinect"]
            path = laid_on(reckoned(run, ROBOT, sizes), kinect.values, kinect.t)
            squares.append(np.sum((path - kinect.values)[:, :2] ** 2, axis=1))
        errors.append(float(np.sqrt(np.mean(np.concatenate(squares)))))
    return {
        "rate_hz": rate_hz, "command": has_command, "verdict": answer.verdict, "effects": sorted(effects),
        "sizes": effects, "before_m": errors[0], "after_m": errors[1], "seconds": answer.seconds,
    }


def main():
    asked = options(__doc__)
    rates, seconds = (RATES_HZ[1:2], 6.0) if asked.tiny else (RATES_HZ[1:3] if asked.quick else RATES_HZ, 30.0)
    commands = (True,) if asked.tiny else (True, False)
    few = {"late_s": 0.0, "lag_s": 0.0, "training": 2, "unseen": 1} if asked.tiny else {}
    library = [di.effects()["single_wheel_radius_error"]] if asked.tiny else None
    rows = [answered(asked.seed, seconds, rate, has, library, **few) for has in commands for rate in rates]
    if asked.json:
        print_json({"answers": rows})
        return
    print_table("Three things hidden in a two-wheeled robot", [
        "camera [Hz]", "command", "verdict", "effects", "before [m]", "after [m]", "time [s]"], [[
            f"{row['rate_hz']:g}", "logged" if row["command"] else "-", row["verdict"], ", ".join(row["effects"]),
            f"{row['before_m']:.4f}", f"{row['after_m']:.4f}", f"{row['seconds']:.0f}",
        ] for row in rows])


if __name__ == "__main__":
    main()
