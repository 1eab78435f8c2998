"""What the scripts of this folder share: their one option, and how they print a run."""

import argparse

from drake_ispace.blocks.messages import WAY_POINT
from drake_ispace.simulation import Run


def seconds_asked(description: str) -> float:
    """The simulated time of `--seconds` [s]."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated time [s], default 20")
    return parser.parse_args().seconds


def print_outcome(run: Run) -> None:
    """Each robot's last pose beside its way point, and how fast the run was."""
    for robot in run.robots:
        x, y, phi = run.signals[f"{robot}_pose"][-1]
        way_x, way_y, way_phi = run.signals[f"{robot}_way_point"][-1, WAY_POINT.x : WAY_POINT.phi + 1]
        print(f"{robot} pose       x {x:+.3f} m  y {y:+.3f} m  phi {phi:+.3f} rad")
        print(f"{robot} way point  x {way_x:+.3f} m  y {way_y:+.3f} m  phi {way_phi:+.3f} rad")
    if run.diverged_s is not None:
        print(f"fallen or lost at {run.diverged_s:.2f} s")
    print(f"{run.time_s[-1]:.1f} s simulated in {run.wall_s:.2f} s, {run.time_s[-1] / run.wall_s:.1f} times real time")
