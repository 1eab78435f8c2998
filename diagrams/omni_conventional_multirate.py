"""Section 6.7.2: the omni robot takes the room's pose as it arrives, raw odometry in between."""

from pathlib import Path

from shared import print_outcome, seconds_asked

import drake_ispace as di

scenario = di.load_scenario("omni_conventional_multirate", [f"seconds={seconds_asked(__doc__)}"])
di.draw(scenario, Path(__file__).with_suffix(".svg"))
print_outcome(di.simulate(scenario))
