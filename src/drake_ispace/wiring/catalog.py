"""The Diagrams by name: those of the package, then those that robots bring along."""

from pathlib import Path

from pydrake.systems.framework import Diagram

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.robots.library import robots
from drake_ispace.scenario import Scenario, as_scenario
from drake_ispace.wiring.entry import Entry
from drake_ispace.wiring.omni import omni_conventional_multirate, omni_multirate, omni_vision_feedback
from drake_ispace.wiring.pendulum import pendulum_jacobian_tracking, pendulum_multirate, pendulum_vision_feedback
from drake_ispace.wiring.rover import odometry_replay, velocity_base
from drake_ispace.wiring.servo import pendulum_friction_compensation, pendulum_servo
from drake_ispace.wiring.space import shared_space

CATALOG: dict[str, Entry] = {
    entry.name: entry for entry in (
        Entry(omni_multirate, ["omni"], has_feedback=True),
        Entry(omni_vision_feedback, ["omni"], has_feedback=True),
        Entry(omni_conventional_multirate, ["omni"], has_feedback=True),
        Entry(pendulum_multirate, ["pendulum"], has_feedback=True),
        Entry(pendulum_vision_feedback, ["pendulum"], has_feedback=True),
        Entry(pendulum_jacobian_tracking, ["pendulum"], has_feedback=True),
        Entry(pendulum_servo, ["pendulum"]),
        Entry(pendulum_friction_compensation, ["pendulum"]),
        Entry(shared_space, ["omni", "pendulum"]),
        Entry(velocity_base, ["rover"]),
        Entry(odometry_replay, ["rover"]),
        *(entry for robot in robots().values() for entry in robot.diagrams),
    )
}


def entry_of(scenario: Scenario) -> Entry:
    """The catalog's entry for `scenario.diagram`.

    Raises:
        InputError: no Diagram of that name.
    """
    if scenario.diagram not in CATALOG:
        raise InputError(f"there is no Diagram {shown(scenario.diagram)}, {expected_one_of(scenario.diagram, CATALOG)}")
    return CATALOG[scenario.diagram]


def build_diagram(scenario: Scenario | str | Path) -> Diagram:
    """The Diagram of a scenario, its name or its file.

    Raises:
        InputError: as `load_scenario`, no Diagram of that name, or values that do not go together.
    """
    scenario = as_scenario(scenario)
    return entry_of(scenario).build(scenario)
