"""Both robots at once under one Kinect."""

from drake_ispace.scenario import Scenario
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.omni import add_omni_multirate
from drake_ispace.wiring.pendulum import add_pendulum
from drake_ispace.wiring.room import add_room


def shared_space(scenario: Scenario, bench: Bench) -> None:
    """`omni_multirate` and `pendulum_multirate` in one room."""
    add_room(bench, scenario, [add_omni_multirate(bench, scenario), add_pendulum(bench, scenario)])
