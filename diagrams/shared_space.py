"""The omni robot and the pendulum in one room, seen by one Kinect."""

from pathlib import Path

from shared import print_outcome, seconds_asked

import drake_ispace as di

scenario = di.load_scenario("shared_space", [f"seconds={seconds_asked(__doc__)}"])
di.draw(scenario, Path(__file__).with_suffix(".svg"))
print_outcome(di.simulate(scenario))
