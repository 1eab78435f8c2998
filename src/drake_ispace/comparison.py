"""Several Diagrams on one reference with one seed."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from drake_ispace.metrics import Metrics, measure
from drake_ispace.robots.library import robots
from drake_ispace.scenario import Scenario, blaming, named_scenarios
from drake_ispace.simulation import Run, simulate_diagram
from drake_ispace.wiring.catalog import build_diagram, entry_of


def on_one_reference(scenarios: Sequence[Scenario]) -> list[Scenario]:
    """Copies of `scenarios`, all with the path, room, seed and duration of the first.

    The same robot starts where it starts in the first; another one starts where the path does and keeps its own way
    of heading along it. A Diagram of several robots keeps its own paths and starts: on one path they would collide.

    Raises:
        InputError: no Diagram of that name.
    """
    first = scenarios[0]
    lead = entry_of(first).robots[0]
    given = getattr(first, lead)
    same = []
    for scenario in scenarios:
        sections = {
            name: dataclasses.replace(
                getattr(scenario, name),
                trajectory=dataclasses.replace(
                    given.trajectory, heading=getattr(scenario, name).trajectory.heading
                ),
                initial_pose=given.initial_pose if name == lead else None,
            )
            for name in robots()
        }
        if len(entry_of(scenario).robots) > 1:
            sections = {}
        same.append(dataclasses.replace(
            scenario, seconds=first.seconds, seed=first.seed, space=first.space, **sections
        ))
    return same


def compare(
    scenarios: Sequence[Scenario | str | Path] | Mapping[str, Scenario | str | Path],
    progress: Callable[[str, float], None] | None = None,
) -> dict[str, tuple[Run, str, Metrics]]:
    """Run every scenario on the first one's reference.

    Args:
        scenarios: Scenarios, their names or their files; a mapping has them under names of your own.
        progress: is told (name, simulated time [s]) now and then.

    Returns:
        name -> (run, robot, metrics); a Diagram of two robots gives "name.omni" and "name.pendulum".

    Raises:
        InputError: as `named_scenarios`, or values that do not go together, found before the first run starts.
    """
    named = named_scenarios(scenarios)
    scenarios = dict(zip(named, on_one_reference(list(named.values())), strict=True))
    diagrams = {}
    for name, scenario in scenarios.items():
        with blaming(name):
            diagrams[name] = build_diagram(scenario)
    results = {}
    for name, scenario in scenarios.items():
        tell = (lambda time_s, name=name: progress(name, time_s)) if progress else None
        run = simulate_diagram(diagrams[name], scenario, tell)
        for robot in run.robots:
            label = name if len(run.robots) == 1 else f"{name}.{robot}"
            results[label] = (run, robot, measure(run, robot))
    return results
