"""All effects by name: those of the package, then those that others register as entry points `drake_ispace.effects`."""

import functools
from collections.abc import Mapping
from importlib.metadata import entry_points

from drake_ispace.blocks.errors import InputError, expected_one_of
from drake_ispace.effects.effect import Body, Effect
from drake_ispace.effects.places import actuator, camera, encoder, ground, imu, link, plant, transmission, velocity
from drake_ispace.files.typed_tree import checked
from drake_ispace.robots.library import robots

_PLACES = (velocity, actuator, transmission, ground, plant, encoder, imu, camera, link)


@functools.cache
def library() -> dict[str, Effect]:
    """Name -> effect, in the order in which they act from command to camera.

    An entry point names an Effect, or a list of them.

    Raises:
        InputError: an entry point that is no effect, or whose name is taken.
    """
    found = {effect.name: effect for place in _PLACES for effect in place.EFFECTS}
    for entry in entry_points(group="drake_ispace.effects"):
        loaded = entry.load()
        for effect in loaded if isinstance(loaded, list | tuple) else [loaded]:
            if not isinstance(effect, Effect):
                where = f"entry point {entry.name} of drake_ispace.effects"
                raise InputError(f"{where}: expected an Effect, got {effect!r}")
            if effect.name in found:
                raise InputError(f"entry point {entry.name}: there is an effect {effect.name} already")
            found[effect.name] = effect
    return found


@functools.cache
def bodies() -> tuple[Body, ...]:
    """Every robot, with the default numbers of its plant."""
    plants = [(robot, robot.settings().plant) for robot in robots().values()]
    return tuple(Body(robot, plant, len(plant.geometry.wheels)) for robot, plant in plants)


def checked_effects(effects: Mapping[str, Mapping], body: Body, where: str) -> dict[str, dict[str, float]]:
    """Effects as a scenario lists them, every name and number checked.

    Raises:
        InputError: an unknown effect or parameter, one that this robot cannot have, a number out of range.
    """
    return {name: _checked_values(name, values, body, f"{where}.{name}") for name, values in effects.items()}


def _checked_values(name, values, body, where):
    if name not in library():
        raise InputError(f"{where}: there is no such effect, {expected_one_of(name, library())}")
    effect = library()[name]
    if not effect.applies_to(body):
        others = [other.name for other in bodies() if effect.applies_to(other)]
        if body.name in others:
            raise InputError(f"{where}: {body.name} cannot have it on these wheels")
        raise InputError(f"{where}: {body.name} cannot have it, expected an effect of {', '.join(others)}")
    rules = {p.name: {"minimum": p.low, "maximum": p.high, "unit": p.unit} for p in effect.parameters_of(body)}
    found = {}
    for key, value in values.items():
        if key in effect.choices:
            found[key] = checked(value, int, {"minimum": 1, "maximum": body.wheels}, f"{where}.{key}")
        elif key in rules:
            found[key] = checked(value, float, rules[key], f"{where}.{key}")
        else:
            raise InputError(f"{where}.{key}: unknown parameter, {expected_one_of(key, [*rules, *effect.choices])}")
    return found
