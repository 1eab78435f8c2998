"""Mistakes that a whole log may have between wheels and camera, each as a way to read the two."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations, permutations, product
from types import MappingProxyType

import numpy as np
from scipy.constants import inch, kilo

from drake_ispace.explain.check.compare.agreement import UNRELATED
from drake_ispace.explain.check.compare.motion import AS_GIVEN, View
from drake_ispace.explain.check.compare.regression import MOST_SLACK, SLACK
from drake_ispace.files.units import in_si
from drake_ispace.plants.wheels import WheelGeometry

#: Recorded unit -> what a number in it must be multiplied by to be in m, or in rad.
LENGTHS = {"mm": in_si("mm"), "cm": in_si("cm"), "inch": inch, "km": kilo}
ANGLES = {unit: in_si(unit) for unit in ("deg", "rev", "mrad")} | {"rad read as deg": 1.0 / in_si("deg")}
#: Recorded unit -> what a number in it must be multiplied by to be in rad/s.
RATES = {"rpm": in_si("rpm"), "rad/s read as deg/s": ANGLES["rad read as deg"]} | {
    f"{unit}/s": in_si(unit) for unit in ("deg", "rev", "mrad")
}
MODEL_SIZE = "model_size"  # which only a command tells from a room of another size
NO_GEARS: Mapping[float, float] = MappingProxyType({})
_EDGES = (2.0, 4.0)  # of a quadrature decoder to a line
_SIZES = (0.8, 1.25)  # of wheels, that are no mistake; what they are off by beside these is physics
_TYPED = (0.5, 2.0)  # tracks and half tracks, or rooms, that are taken for each other
_SCALES = (*_TYPED, 0.01, 0.1, 10.0)  # of a room in another unit than it is read as
_FACTORS = (*_EDGES, *np.reciprocal(_EDGES).tolist())


@dataclass(frozen=True)
class Reading:
    """A way to read wheels and camera.

    Attributes:
        fault: its name; empty: as given. what: in words. channel: that is at fault. rare: as of Hypothesis.
        wheels: (n, n) matrix on the wheels' angles. body: (3, 3) matrix on the motion that the model makes of them.
        view: of the camera. advice: what to do where the model is at fault. of: as of Hypothesis.
    """

    fault: str
    what: str
    channel: str
    wheels: np.ndarray
    body: np.ndarray = field(default_factory=lambda: np.eye(3))
    view: View = AS_GIVEN
    rare: bool = False
    advice: str = ""
    of: tuple["Reading", ...] = ()

    @property
    def shared(self) -> bool:
        """As of Hypothesis."""
        return self.channel == "model"

    def then(self, other: "Reading") -> "Reading":
        """This mistake and another, of which this one is undone first."""
        return Reading(
            f"{self.fault}, {other.fault}", f"{self.what}, and {other.what}", other.channel, other.wheels @ self.wheels,
            other.body @ self.body, self.view.then(other.view), self.rare or other.rare, of=(self, other),
        )


def readings(
    geometry: WheelGeometry, counts_per_turn: float, gears: Mapping[float, float] = NO_GEARS, times: float = 1.0,
    room: float = 1.0, turns_rad: Iterable[float] = (), wheels_rad: Iterable[float] = (), skids: bool = False,
) -> list[Reading]:
    """All readings of a robot with these wheels, that as given first.

    gears: by which the wheels may turn too little -> what was measured of each. times: how many times as far as the
    camera sees, the wheels turn the model. room: how many times as far as the wheels say, the camera sees the robot go.
    turns_rad: by which its ways may be turned against those that the wheels say. wheels_rad: by which the model's
    wheels may be turned, where a command tells it from that. skids: whether its tyres skid by a share that the model
    does not tell.

    Some accuse nobody: as given, no relation at all, none but of the turns, a narrower track, and wheels of another
    size, which makes way and turns differ alike and is one cause, not two. Without the third a mistake that makes the
    way by the wheels next to nothing, such as places in km, would explain wheels that wobble on the spot.
    """
    unit = np.eye(len(geometry.wheels))
    by_turns = 1.0 / times  # on which a marker beside the middle makes no difference, as it does on ways
    sizes = (*_SIZES, by_turns) if abs(by_turns - 1.0) <= MOST_SLACK else _SIZES
    return [
        Reading("", "as given", "", unit), Reading("", UNRELATED, "", 0.0 * unit),
        Reading("", "wheels that wobble on the spot", "", unit, np.diag([0.0, 0.0, 1.0])),
        *(Reading("", f"{size:g} times as large", "", size * unit, rare=True) for size in sizes),
        *_wheel_signs(unit), *_wheel_orders(unit), *_factors(unit, counts_per_turn, gears),
        *_tracks(unit, times, skids), *_axes(unit), *_units(unit), *_units_of_one(unit), *_rooms(unit, room),
        *(_turned(unit, turn_rad) for turn_rad in turns_rad),
        *(wheel_angles(geometry, turn_rad) for turn_rad in wheels_rad),
    ]


def pairs(geometry: WheelGeometry, counts_per_turn: float, gears: Mapping[float, float] = NO_GEARS) -> list[Reading]:
    """All readings of two mistakes at once, of different kinds; arguments as of `readings`.

    Of several wheels that count backwards or change places only the usual ones, and of axes. Places and headings in
    other units are one mistake in these.
    """
    unit = np.eye(len(geometry.wheels))
    signs, orders, axes = ([one for one in kind(unit) if not one.rare] for kind in (_wheel_signs, _wheel_orders, _axes))
    kinds = [list(_factors(unit, counts_per_turn, gears)), signs, orders, list(_units(unit)), axes]
    return [one.then(other) for kind, others in combinations(kinds, 2) for one, other in product(kind, others)]


def _wheel_signs(unit):
    n = len(unit)
    yield Reading("encoder_sign", "all wheels count backwards", "encoder", -unit)
    for size in range(1, n):
        for chosen in combinations(range(n), size):
            sign = np.where(np.isin(range(n), chosen), -1.0, 1.0)
            yield Reading("wheel_sign", f"{_numbers(chosen)} counts backwards", "encoder", np.diag(sign), rare=size > 1)


def _wheel_orders(unit):
    n = len(unit)
    if n > 5:  # of more wheels only two that change places
        orders = [_exchanged(n, i, j) for i, j in combinations(range(n), 2)]
    else:
        orders = [order for order in permutations(range(n)) if order != tuple(range(n))]
    for order in orders:
        moved = sum(k != i for i, k in enumerate(order))
        said = ", ".join(str(k + 1) for k in order)
        yield Reading("wheels_swapped", f"the wheels in the order {said}", "encoder", unit[list(order)], rare=moved > 2)


def _exchanged(n, i, j):
    order = list(range(n))
    order[i], order[j] = j, i
    return tuple(order)


def _factors(unit, counts_per_turn, gears):
    n = len(unit)
    units = dict(ANGLES)
    if counts_per_turn > 0.0:
        units["counts"] = 2.0 * np.pi / counts_per_turn
    for name, factor in units.items():
        yield Reading("wrong_unit", f"angles in {name}", "encoder", factor * unit)
    for factor in (*_FACTORS, *(gear for gear in sorted(gears) if gear not in _FACTORS)):
        by, measured = 1.0 / factor, 1.0 / gears.get(factor, factor)
        said = f"turns {by:.3g} times too large"
        said += f", as measured {measured:.3g} times" if f"{measured:.2g}" != f"{by:.2g}" else ""
        yield Reading("counts_per_turn", said, "encoder", factor * unit, rare=factor not in _FACTORS)
    for i in range(n):
        for factor in (*_FACTORS, ANGLES["deg"]):
            diagonal = np.ones(n)
            diagonal[i] = factor
            fault = "wrong_unit" if factor == ANGLES["deg"] else "counts_per_turn"
            yield Reading(fault, f"wheel {i + 1} turns {1.0 / factor:.3g} times too far", "encoder", np.diag(diagonal))


def _tracks(unit, times, skids):
    """A robot that skids turns less than its wheels say, never more; one that turns more has a narrower track.

    Where the model tells no track, a wider one accuses nobody.

    Where it could be half a track that was typed, within what physics may add, it is taken for that. A track that is
    narrower than half was not measured on this robot.
    """
    if skids and times > 1.0:
        yield Reading("", "tyres that skid", "", unit, np.diag([1.0, 1.0, 1.0 / times]))
        return
    for wide in _TYPED:
        yield _track(unit, "half_track", f"{wide:.2g} times", wide)
    if _typed(times, _TYPED) is not None:
        return
    if times > 1.0:
        yield _track(unit, "effective_track", f"about {times:.2g} times", times)
    elif times < min(_TYPED):
        yield _track(unit, "wrong_track", f"about {times:.2g} times", times)
    elif times < 1.0:
        yield Reading("", "a narrower track", "", unit, np.diag([1.0, 1.0, 1.0 / times]), rare=True)


def _track(unit, fault, by, wide):
    return Reading(
        fault, f"the model turns {by} as far as the robot", "model", unit, np.diag([1.0, 1.0, 1.0 / wide]),
        rare=wide not in _TYPED, advice=f"make the model's track {by} as wide",
    )


def _typed(times, factors):
    """The one of some factors that may be meant, within what physics may add; None: none."""
    return next((typed for typed in factors if abs(times / typed - 1.0) <= SLACK), None)


def _rooms(unit, times):
    """Places in a unit that nobody knows, so many times as large as physics cannot make them, or a model as small."""
    size = _typed(times, _SCALES) or times
    if abs(times - 1.0) > MOST_SLACK and all(abs(times * m - 1.0) > SLACK for m in LENGTHS.values()):
        by, rare = f"{'' if size in _SCALES else 'about '}{size:.2g} times as large", size not in _SCALES
        measured = f", as measured {times:.3g} times" if f"{times:.2g}" != f"{size:.2g}" else ""
        view = View(((1.0 / size, 0.0), (0.0, 1.0 / size)))
        yield Reading("wrong_unit", f"places {by} as the wheels say{measured}", "kinect", unit, view=view, rare=rare)
        yield Reading(
            MODEL_SIZE, f"the robot is {by}{measured}", "model", unit, np.diag([size, size, 1.0]), rare=rare,
            advice=f"make the model's wheels, and the distances between them, {by}",
        )


def wheel_angles(geometry: WheelGeometry, turn_rad: float) -> Reading:
    """Wheels that sit at other angles about the robot's middle than the model says, all turned alike.

    To wheels and camera that is the same as headings that are off; turn_rad: as of `readings`.
    """
    c, s, degrees = np.cos(turn_rad), np.sin(turn_rad), np.rad2deg(turn_rad)
    return Reading(
        "wheel_angles", f"which are turned by {-degrees:.0f} degrees", "model", np.eye(len(geometry.wheels)),
        np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), rare=True,
        advice=f"turn the model's wheels about the robot's middle by {degrees:.0f} degrees",
    )


def _turned(unit, turn_rad):
    """Headings that are off by any angle, as those of a marker that is fitted turned."""
    said = f"headings off by {-np.rad2deg(turn_rad):.0f} degrees"
    return Reading("heading_offset", said, "kinect", unit, view=View(offset_rad=turn_rad), rare=True)


def _units(unit):
    """Units of places and headings."""
    for (length, metre), (angle, radian) in product({"m": 1.0, **LENGTHS}.items(), {"rad": 1.0, **ANGLES}.items()):
        units = (f"places in {length}", metre), (f"headings in {angle}", radian)
        wrong = [text for text, factor in units if factor != 1.0]
        if wrong:
            view = View(((metre, 0.0), (0.0, metre)), radian)
            yield Reading("wrong_unit", " and ".join(wrong), "kinect", unit, view=view, rare=len(wrong) > 1)


def _units_of_one(unit):
    """Units of a single column of the places."""
    for length, metre in LENGTHS.items():
        for name, rows in {"x": ((metre, 0.0), (0.0, 1.0)), "y": ((1.0, 0.0), (0.0, metre))}.items():
            yield Reading("wrong_unit", f"{name} in {length}", "kinect", unit, view=View(rows))


def _axes(unit):
    """Every distinct way to mistake axes and heading; a room turned by a quarter is a heading that is off by one."""
    for fault, what, view, rare in _views():
        yield Reading(fault, what, "kinect", unit, view=view, rare=rare)


def _views():
    mirrored = {
        "the y axis is mirrored": ((1.0, 0.0), (0.0, -1.0)), "the x axis is mirrored": ((-1.0, 0.0), (0.0, 1.0)),
    }
    swapped = {
        "x and y change places": ((0.0, 1.0), (1.0, 0.0)),
        "x and y change places and signs": ((0.0, -1.0), (-1.0, 0.0)),
    }
    for what, axes in mirrored.items():
        yield "camera_axis_mirrored", what, View(axes), False
    for what, axes in swapped.items():
        yield "camera_axes_swapped", what, View(axes), False
    for quarter in range(4):
        off = {1: "-90", 2: "180", 3: "90"}.get(quarter)
        by = f", headings off by {off} degrees" if off else ""
        turn, rare = (quarter if quarter < 3 else -1) * np.pi / 2.0, bool(off)
        if off:
            yield "heading_offset", f"headings off by {off} degrees", View(offset_rad=turn), False
        compass = quarter == 1
        said = "headings of a compass, clockwise from the y axis" if compass else f"headings of the other sense{by}"
        yield "heading_sign", said, View(scale=-1.0, offset_rad=turn), rare and not compass
        room = View(((1.0, 0.0), (0.0, -1.0)), -1.0, turn)
        yield "camera_axis_mirrored", f"the room is mirrored, y and headings{by}", room, rare


def _numbers(chosen):
    names = [str(i + 1) for i in chosen]
    return f"wheel {names[0]}" if len(names) == 1 else f"wheels {' and '.join(names)}"
