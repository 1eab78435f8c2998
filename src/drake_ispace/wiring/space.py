"""Both robots at once under one Kinect."""

from pydrake.systems.framework import Diagram

from drake_ispace.scenario import Scenario
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.omni import OMNI_VIEW, add_omni_multirate
from drake_ispace.wiring.pendulum import PENDULUM_VIEW, add_pendulum
from drake_ispace.wiring.room import add_room


def shared_space(scenario: Scenario) -> Diagram:
    """`omni_multirate` and `pendulum_multirate` in one room."""
    bench = Bench()
    add_omni_multirate(bench, scenario)
    add_pendulum(bench, scenario)
    add_room(bench, scenario, OMNI_VIEW | PENDULUM_VIEW)
    return bench.build("shared_space")
