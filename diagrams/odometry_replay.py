"""Wheel angles to a pose: a differential drive follows its path by odometry alone while the room looks on."""

from pathlib import Path

from shared import print_outcome, seconds_asked

import drake_ispace as di

scenario = di.load_scenario("odometry_replay", [f"seconds={seconds_asked(__doc__)}"])
di.draw(scenario, Path(__file__).with_suffix(".svg"))
print_outcome(di.simulate(scenario))
