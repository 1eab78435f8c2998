"""Fig. 6.9: the omni robot under a PID on the room's pose alone, renewed every 95 ms."""

from pathlib import Path

from shared import print_outcome, seconds_asked

import drake_ispace as di

scenario = di.load_scenario("omni_vision_feedback", [f"seconds={seconds_asked(__doc__)}"])
di.draw(scenario, Path(__file__).with_suffix(".svg"))
print_outcome(di.simulate(scenario))
