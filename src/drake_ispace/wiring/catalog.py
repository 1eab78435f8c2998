"""The Diagrams by name."""

from collections.abc import Callable
from pathlib import Path

from pydrake.systems.framework import Diagram

from drake_ispace.errors import InputError, expected_one_of, shown
from drake_ispace.scenario import Scenario, as_scenario
from drake_ispace.wiring.omni import omni_conventional_multirate, omni_multirate, omni_vision_feedback
from drake_ispace.wiring.pendulum import pendulum_jacobian_tracking, pendulum_multirate, pendulum_vision_feedback
from drake_ispace.wiring.rover import odometry_replay, velocity_base
from drake_ispace.wiring.servo import pendulum_friction_compensation, pendulum_servo
from drake_ispace.wiring.space import shared_space

CATALOG: dict[str, Callable[[Scenario], Diagram]] = {
    builder.__name__: builder for builder in (
        omni_multirate, omni_vision_feedback, omni_conventional_multirate, pendulum_multirate,
        pendulum_vision_feedback, pendulum_jacobian_tracking, pendulum_servo, pendulum_friction_compensation,
        shared_space, velocity_base, odometry_replay,
    )
}


def build_diagram(scenario: Scenario | str | Path) -> Diagram:
    """The Diagram of a scenario, its name or its file.

    Raises:
        InputError: as `load_scenario`, no Diagram of that name, or values that do not go together.
    """
    scenario = as_scenario(scenario)
    if scenario.diagram not in CATALOG:
        raise InputError(f"there is no Diagram {shown(scenario.diagram)}, {expected_one_of(scenario.diagram, CATALOG)}")
    return CATALOG[scenario.diagram](scenario)
