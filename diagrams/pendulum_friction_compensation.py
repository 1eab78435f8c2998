"""Fig. 4.1: friction compensation, a push on both wheels from 1.2 to 1.6 s, an identifier that listens."""

from pathlib import Path

from shared import print_outcome, seconds_asked

import drake_ispace as di

scenario = di.load_scenario("pendulum_friction_compensation", [f"seconds={seconds_asked(__doc__)}"])
di.draw(scenario, Path(__file__).with_suffix(".svg"))
print_outcome(di.simulate(scenario))
