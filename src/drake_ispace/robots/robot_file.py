"""Robot files: the wheels of any robot in the words of a data sheet, as the scenario that `explain` takes.

    name: cart
    kind: differential          # differential | omni | mecanum | tricycle | listed
    wheel_diameter_m: 0.132     # or wheel_radius_m
    track_m: 0.30               # from wheel to wheel, or half_track_m
    wheels: [right, left]       # their names
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.linalg import null_space

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.files.quantity import quantity
from drake_ispace.files.typed_tree import read
from drake_ispace.files.yaml_guard import load_yaml
from drake_ispace.plants.wheels import Wheel, WheelGeometry

KINDS = ("differential", "omni", "mecanum", "tricycle", "listed")
_NAMES = {
    "differential": ["right", "left"], "tricycle": ["right", "left"],
    "mecanum": ["front_left", "front_right", "rear_left", "rear_right"],
}
#: Kind -> sizes, each given in one of two ways: the key of a data sheet, and the key of half of it.
_SIZES = {
    "differential": (("wheel_diameter_m", "wheel_radius_m"), ("track_m", "half_track_m")),
    "omni": (("wheel_diameter_m", "wheel_radius_m"), ("centre_diameter_m", "centre_distance_m")),
    "mecanum": (
        ("wheel_diameter_m", "wheel_radius_m"), ("track_m", "half_track_m"), ("wheelbase_m", "half_wheelbase_m"),
    ),
    "listed": (),
}
_SIZES["tricycle"] = _SIZES["mecanum"]
#: Of a tricycle: columns of its steered and driven front wheel in a log, whose motion the rear wheels take over.
STEERED = ("theta_front", "steer_front")
#: What a recording notes of them.
REAR_COMPUTED = "angles of the rear wheels, computed from those of the front wheel and of its steering"
_MOTIONS = ("forward", "sideways", "turning")


@dataclass
class WheelEntry:
    """A wheel of a robot of the kind `listed`."""

    x_m: float = quantity(0.0, "m", minimum=-10.0, maximum=10.0)
    y_m: float = quantity(0.0, "m", minimum=-10.0, maximum=10.0)
    # the way the robot goes at this wheel when it turns forward, from the robot's x axis, anticlockwise
    drive_deg: float = quantity(0.0, "deg", minimum=-360.0, maximum=360.0)
    diameter_m: float = quantity(0.1, "m", above=0.0, maximum=5.0)
    # between a roller's axis and the drive direction, 45 or -45 for mecanum wheels
    roller_deg: float = quantity(0.0, "deg", above=-90.0, below=90.0)
    # whether it is a plain tyre, which cannot move sideways
    tyre: bool = quantity(False)


@dataclass
class _Keys:
    """The keys of a robot file, besides `wheels`."""

    name: str = quantity("my_robot")
    kind: str = quantity("differential", choices=KINDS)
    wheel_diameter_m: float | None = quantity(None, "m", above=0.0, maximum=5.0)
    wheel_radius_m: float | None = quantity(None, "m", above=0.0, maximum=5.0)
    track_m: float | None = quantity(None, "m", above=0.0, maximum=20.0)
    half_track_m: float | None = quantity(None, "m", above=0.0, maximum=20.0)
    wheelbase_m: float | None = quantity(None, "m", above=0.0, maximum=20.0)
    half_wheelbase_m: float | None = quantity(None, "m", above=0.0, maximum=20.0)
    centre_distance_m: float | None = quantity(None, "m", above=0.0, maximum=20.0)
    centre_diameter_m: float | None = quantity(None, "m", above=0.0, maximum=20.0)
    # omni: direction of each wheel from the robot's middle, from its x axis, anticlockwise
    angles_deg: list[float] = quantity([], "deg", minimum=-360.0, maximum=360.0)
    # omni: the way the robot turns when all wheels turn forward
    forward_turns: str = quantity("anticlockwise", choices=("anticlockwise", "clockwise"))
    # encoder counts of a turn of a wheel; null: unknown
    counts_per_turn: float | None = quantity(None, above=0.0)
    # of the positions that a camera or motion capture reports
    position_accuracy_m: float = quantity(0.001, "m", above=0.0, maximum=1.0)
    # whether the robot took velocities as commands that were logged
    commanded: bool = quantity(False)


@dataclass(frozen=True)
class NamedWheel:
    """A wheel and its name, by which the columns of logs are found."""

    name: str
    wheel: Wheel


@dataclass(frozen=True)
class RobotFile:
    """A robot as its file says.

    Attributes:
        keys: all that is no wheel. wheels: in the order of the file.
    """

    keys: _Keys = field(repr=False)
    wheels: tuple[NamedWheel, ...]

    @property
    def name(self) -> str:
        return self.keys.name

    @property
    def geometry(self) -> WheelGeometry:
        return WheelGeometry(tuple(entry.wheel for entry in self.wheels))

    @property
    def wheelbase_m(self) -> float:
        """From the rear axle to the front wheel of a tricycle [m]."""
        return self.keys.wheelbase_m or 2.0 * self.keys.half_wheelbase_m

    def rear_angles(self, front: np.ndarray, steering: np.ndarray) -> np.ndarray:
        """(n, 2) angles of a tricycle's rear wheels that go with those of its front wheel and its steering (n,) [rad].

        All wheels have the same radius. Between two samples the steering is their mean.
        """
        turned, radius = np.diff(front, prepend=front[0]), self.wheels[0].wheel.radius_m
        mean = (steering + np.concatenate([steering[:1], steering[:-1]])) / 2.0
        forward, turn = radius * turned * np.cos(mean), radius * turned * np.sin(mean) / self.wheelbase_m
        moved = np.column_stack([forward, np.zeros(len(front)), turn])
        return np.cumsum(moved @ self.geometry.inverse.T, axis=0)

    def scenario(self) -> dict:
        """The scenario of this robot as plain data: a model for `explain`."""
        rows = [
            [float(number) for number in (w.x_m, w.y_m, w.drive_rad, w.radius_m, w.roller_rad, w.holds_sideways)]
            for w in (entry.wheel for entry in self.wheels)
        ]
        encoder = {} if self.keys.counts_per_turn is None else {
            "encoder": {"counts_per_turn": round(self.keys.counts_per_turn)}
        }
        plant = {"wheels": "listed", "wheel_list": rows, "wheel_names": [entry.name for entry in self.wheels]}
        heading = {} if len(self.geometry.sideways) == 0 else {"trajectory": {"heading": "tangent"}}
        accuracy = self.keys.position_accuracy_m
        return {
            "diagram": "velocity_base" if self.keys.commanded else "odometry_replay",
            "rover": {"plant": plant, **encoder, **heading},
            "space": {"localizer": {
                "pixel_m": [accuracy / 5.0, accuracy / 5.0], "noise_std_pixels": 5.0, "whole_pixels": False,
            }},
        }

    def cannot(self) -> list[str]:
        """Motions that the wheels cannot make, in words."""
        if not len(self.geometry.sideways):
            return []
        free = null_space(self.geometry.sideways)
        return [f"{_MOTIONS[int(np.abs(held).argmax())]}: the tyres hold it" for held in null_space(free.T).T]

    def doubts(self) -> list[str]:
        """What looks wrong, each in a sentence."""
        wheels, found = [entry.wheel for entry in self.wheels], []
        for i, one in enumerate(self.wheels):
            for other in self.wheels[:i]:
                apart = np.hypot(one.wheel.x_m - other.wheel.x_m, one.wheel.y_m - other.wheel.y_m)
                if apart < 0.1 * (one.wheel.radius_m + other.wheel.radius_m):
                    found.append(f"wheels {other.name} and {one.name} stand {apart:.3g} m apart, in the same place")
        reach = max(np.hypot(w.x_m, w.y_m) for w in wheels)
        largest = max(w.radius_m for w in wheels)
        if largest > reach:
            found.append(
                f"a wheel's radius, {largest:.3g} m, is larger than its distance from the robot's middle, "
                f"{reach:.3g} m; is a diameter given for a radius, or half a track for a track?"
            )
        if reach > 40.0 * largest:
            found.append(
                f"wheels of {2 * largest:.3g} m diameter on a robot {2 * reach:.3g} m wide; are all sizes in metres?"
            )
        gains = np.linalg.svd(self.geometry.inverse @ np.diag([1.0, 1.0, 1.0 / reach]), compute_uv=False)
        if not len(self.geometry.sideways) and gains[-1] < 0.05 * gains[0]:
            found.append("one motion hardly turns any wheel: are rollers or drive directions as on the robot?")
        return found


def robot_of(path: Path) -> RobotFile:
    """The robot in a YAML file.

    Raises:
        InputError: as `read_robot`.
    """
    return read_robot(load_yaml(path, str(path)), str(path))


def read_robot(data, where: str) -> RobotFile:
    """The robot of plain data.

    Raises:
        InputError: an unknown key, a size that is missing or given twice, wheels that leave a motion unseen.
    """
    if not isinstance(data, dict):
        raise InputError(f"{where}: expected a mapping with name, kind and sizes, got {shown(data)}")
    keys = read(_Keys(), {key: value for key, value in data.items() if key != "wheels"}, where)
    if not keys.name.isidentifier():
        raise InputError(f"{where}: name is {shown(keys.name)}, expected letters, digits and _")
    sizes = {}
    for whole, half in _SIZES[keys.kind]:
        given = [key for key in (whole, half) if getattr(keys, key) is not None]
        if len(given) != 1:
            raise InputError(f"{where}: expected {whole} or {half}, got {'both' if given else 'neither'}")
        sizes[whole] = getattr(keys, whole) or 2.0 * getattr(keys, half)
    for key in {k for pairs in _SIZES.values() for pair in pairs for k in pair} - {
        k for pair in _SIZES[keys.kind] for k in pair
    }:
        if getattr(keys, key) is not None:
            raise InputError(f"{where}: {key}: a robot of kind {keys.kind} has none")
    wheels = tuple(_wheels(keys, sizes, data.get("wheels"), where))
    try:
        WheelGeometry(tuple(entry.wheel for entry in wheels))
    except ValueError as error:
        raise InputError(f"{where}: wheels: {error}") from None
    return RobotFile(keys, wheels)


def _wheels(keys, sizes, given, where):
    if keys.kind == "listed":
        if not isinstance(given, dict) or not given:
            raise InputError(f"{where}: wheels: expected a mapping of names with x_m, y_m, drive_deg and diameter_m")
        for name, entry in given.items():
            one = read(WheelEntry(), entry, f"{where}: wheels.{name}")
            yield NamedWheel(_checked(name, where), Wheel(
                one.x_m, one.y_m, np.radians(one.drive_deg), one.diameter_m / 2.0, np.radians(one.roller_deg), one.tyre
            ))
        return
    count = len(keys.angles_deg) if keys.kind == "omni" else len(_NAMES[keys.kind])
    names = given if given is not None else _NAMES.get(keys.kind) or [str(i + 1) for i in range(count)]
    if not isinstance(names, list) or len(names) != count or len(set(map(str, names))) < count:
        raise InputError(f"{where}: wheels: expected {count} different names in a list, got {shown(names)}")
    radius = sizes["wheel_diameter_m"] / 2.0
    if keys.kind == "omni":
        if count < 3:
            raise InputError(f"{where}: angles_deg: expected at least three directions, got {count}")
        side = np.pi / 2.0 if keys.forward_turns == "anticlockwise" else -np.pi / 2.0
        distance = sizes["centre_diameter_m"] / 2.0
        angles = np.radians(keys.angles_deg)
        at = np.round(distance * np.column_stack([np.cos(angles), np.sin(angles)]), 15)  # of 90 degrees x is zero
        places = [Wheel(x, y, angle + side, radius) for (x, y), angle in zip(at.tolist(), angles, strict=True)]
    elif keys.kind in ("differential", "tricycle"):
        half = sizes["track_m"] / 2.0
        sides = {_side(name, where): name for name in map(str, names)}
        if set(sides) != {"left", "right"}:
            raise InputError(f"{where}: wheels: expected one name with left and one with right, got {shown(names)}")
        places = [
            Wheel(0.0, half if _side(str(name), where) == "left" else -half, 0.0, radius, holds_sideways=True)
            for name in names
        ]
    else:
        a, b = sizes["wheelbase_m"] / 2.0, sizes["track_m"] / 2.0
        places = []
        for name in map(str, names):
            ahead, left = ("front" in name or name.startswith("f")), _side(name, where) == "left"
            roller = -np.pi / 4.0 if ahead == left else np.pi / 4.0  # rollers seen from above make an X
            places.append(Wheel(a if ahead else -a, b if left else -b, 0.0, radius, roller))
        if len({(wheel.x_m, wheel.y_m) for wheel in places}) < count:
            raise InputError(
                f"{where}: wheels: expected front or rear, left or right of each corner, got {shown(names)}"
            )
    yield from (NamedWheel(_checked(name, where), wheel) for name, wheel in zip(names, places, strict=True))


def _side(name, where):
    """left or right, by the name of a wheel."""
    words = name.lower().replace("-", "_").split("_")
    for side, short in (("left", "l"), ("right", "r")):
        if side in words or short in words or (len(words[-1]) == 2 and words[-1].endswith(short)):
            return side
    raise InputError(f"{where}: wheels: {shown(name)} says neither left nor right, expected one of both in the name")


def _checked(name, where):
    if not str(name).replace("_", "a").isalnum() or not str(name).isascii():
        raise InputError(f"{where}: wheels: {shown(name)}: expected names of letters, digits and _")
    return str(name)
