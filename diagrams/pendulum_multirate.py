"""Fig. 6.6: the pendulum balances and tracks at 5 ms; way point and tracker run at 95 ms."""

from pathlib import Path

from shared import print_outcome, seconds_asked

import drake_ispace as di

scenario = di.load_scenario("pendulum_multirate", [f"seconds={seconds_asked(__doc__)}"])
di.draw(scenario, Path(__file__).with_suffix(".svg"))
print_outcome(di.simulate(scenario))
