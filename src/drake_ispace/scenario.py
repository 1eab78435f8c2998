"""One commented tree of dataclasses that describes a whole run; a YAML file overrides it.

Defaults are the thesis's tables where they hold and stated assumptions where it is silent (docs/fidelity.md). The
packaged scenarios, one per Diagram and one per `*_as_printed` variant, lie in `scenarios/`.
"""

import dataclasses
import typing
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.blocks.rates import MAX_TICK, TICK_S
from drake_ispace.effects.effect import body_of
from drake_ispace.effects.library import checked_effects
from drake_ispace.files import typed_tree
from drake_ispace.files.quantity import quantity
from drake_ispace.files.typed_tree import checked, read
from drake_ispace.files.yaml_guard import load_yaml
from drake_ispace.robots.library import robots
from drake_ispace.room.room import Space


@dataclass
class _Common:
    """A Diagram of the catalog with everything it is made of."""

    # a name of the catalog
    diagram: str = quantity("omni_multirate")
    seconds: float = quantity(30.0, "s", minimum=TICK_S, maximum=MAX_TICK * TICK_S)
    seed: int = quantity(0, minimum=0)
    space: Space = field(default_factory=Space)


#: A Diagram of the catalog with everything it is made of: the fields of _Common, then a section for every robot, its
#: `settings` under its name.
Scenario = dataclasses.make_dataclass(
    "Scenario", [(robot.name, robot.settings, field(default_factory=robot.settings)) for robot in robots().values()],
    bases=(_Common,), namespace={"__doc__": _Common.__doc__},
)
Scenario.__module__ = __name__  # for pickle


def scenario_names() -> list[str]:
    """The packaged scenarios."""
    folder = resources.files("drake_ispace") / "scenarios"
    return sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_scenario(name_or_file: str, overrides: typing.Sequence[str] = ()) -> Scenario:
    """The scenario of that name, or in that YAML file, with `key.path=value` overrides applied in order.

    Raises:
        InputError: unknown name, unreadable file, unknown key, wrong type, value out of range.
    """
    if name_or_file in scenario_names():
        file = resources.files("drake_ispace") / "scenarios" / f"{name_or_file}.yaml"
        data = load_yaml(file.read_text(encoding="utf-8"), name_or_file)
        where = name_or_file
    elif name_or_file.endswith((".yaml", ".yml")) or "/" in name_or_file:
        data, where = load_yaml(Path(name_or_file), name_or_file), name_or_file
    else:
        hint = expected_one_of(name_or_file, scenario_names())
        raise InputError(f"there is no scenario {shown(name_or_file)}, {hint}")
    scenario = read(Scenario(), data, where)
    for override in overrides:
        key, equals, text = override.partition("=")
        key = key.strip()
        if not equals or not key or key.count(".") > 9 or not override.isprintable():
            raise InputError(f"--set {shown(override)}: expected key=value, such as omni.plant.mass_kg=8")
        value = load_yaml(f"value: {text}\n", f"--set {key}")["value"]
        for part in reversed(key.split(".")):
            value = {part: value}
        scenario = read(scenario, value, "--set")
    for robot in robots().values():
        _check(scenario, robot, where)
    return scenario


def as_scenario(given: Scenario | str | Path) -> Scenario:
    """The Scenario itself, or the one of that name or in that file.

    Raises:
        InputError: neither of these, or as `load_scenario`.
    """
    if isinstance(given, Scenario):
        return given
    if not isinstance(given, str | Path):
        raise InputError(f"expected a Scenario, or the name or file of one, got {shown(given)}")
    return load_scenario(str(given))


def named_scenarios(
    given: Scenario | str | Path | Sequence[Scenario | str | Path] | Mapping[str, Scenario | str | Path]
) -> dict[str, Scenario]:
    """One scenario or several by name: a mapping's own names, else a scenario's name, file or Diagram.

    Raises:
        InputError: none at all, the same name twice, or as `as_scenario`.
    """
    if isinstance(given, Mapping):
        pairs = list(given.items())
    else:
        listed = [given] if isinstance(given, Scenario | str | Path) else given
        pairs = [(one.diagram if isinstance(one, Scenario) else str(one), one) for one in listed]
    names = [name for name, _ in pairs]
    if not names:
        raise InputError("there is no scenario, expected at least one")
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"{shown(twice[0])} is named twice, expected different names, as in a mapping of your own")
    return {name: as_scenario(one) for name, one in pairs}


def with_option(scenario: Scenario, name: str, value) -> Scenario:
    """A copy with the top-level number `name` replaced, for an option --name.

    Raises:
        InputError: naming the option.
    """
    (found,) = (f for f in dataclasses.fields(scenario) if f.name == name)
    return dataclasses.replace(scenario, **{name: checked(value, found.type, found.metadata, f"--{name}")})


@contextmanager
def blaming(where: str):
    """Put `where`, the scenario's name or file, in front of what is wrong with values that do not go together.

    Raises:
        InputError: for an InputError raised inside, and for extreme values with which no Diagram can be computed.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    except ValueError as error:  # a singular matrix too
        reason = str(error).rstrip(".")
        raise InputError(
            f"{where}: no Diagram can be computed from these values ({reason}), expected plant and control closer to "
            "the defaults"
        ) from None


def _check(scenario, robot, where):
    """Raise InputError where the values of a robot's section do not go together; its effects get all their numbers."""
    settings, own = getattr(scenario, robot.name), f"{where}: {robot.name}"
    width, depth, pose = scenario.space.width_m, scenario.space.depth_m, settings.initial_pose
    if pose is not None and not (abs(pose[0]) <= width / 2 and abs(pose[1]) <= depth / 2):
        raise InputError(
            f"{own}.initial_pose: ({pose[0]:.3g}, {pose[1]:.3g}) m lies outside of the {width:g} x {depth:g} m space, "
            f"expected |x| <= {width / 2:g} and |y| <= {depth / 2:g}"
        )
    robot.check(settings, own)
    with blaming(where):
        body = body_of(scenario, robot)
    settings.effects = checked_effects(settings.effects, body, f"{own}.effects")


def to_data(scenario) -> dict:
    """The whole tree as plain mappings, ready for YAML."""
    return dataclasses.asdict(scenario)


def difference(scenario: Scenario) -> dict:
    """Only what differs from the defaults: the shortest YAML that gives this scenario."""
    return typed_tree.difference(to_data(scenario), to_data(Scenario())) | {"diagram": scenario.diagram}
