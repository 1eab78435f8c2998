"""Mistakes that the columns of torque, command and IMU may have: signs, order and units, each as a matrix on them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np

from drake_ispace.explain.check.compare.agreement import UNRELATED
from drake_ispace.explain.check.compare.gyro_rates import scales as gyro_scales
from drake_ispace.explain.check.compare.hypotheses import ANGLES, LENGTHS, RATES
from drake_ispace.explain.check.compare.links import UNKNOWN_INERTIA
from drake_ispace.explain.check.compare.ratio import TORQUES
from drake_ispace.explain.check.compare.scale import is_unit, scales
from drake_ispace.files.units import in_si
from drake_ispace.plants.slip import GRAVITY

_MOTORS = 1.0 / 0.3  # times as much torque as the weakest motor of the effects gives


@dataclass(frozen=True)
class Columns:
    """A way to read the columns of a channel: values = matrix times recorded ones, plus offset.

    Attributes:
        fault: its name; empty: as given. what: in words. rare: as of Hypothesis. related: 0 where the channel, or each
            column by itself, says nothing of the robot's motion. advice: none, the data are at fault. of, shared: as of
            Hypothesis. in_room: whether vx, vy are along the axes of the room, and are turned by the heading before.
    """

    fault: str
    what: str
    matrix: np.ndarray
    rare: bool = False
    offset: np.ndarray | None = None
    related: float | tuple[float, ...] = 1.0
    advice: str = ""
    of: tuple["Columns", ...] = ()
    shared: bool = False
    in_room: bool = False

    def then(self, other: "Columns") -> "Columns":
        """This mistake and another, of which this one is undone first."""
        offset = other.offset
        if self.offset is not None:
            offset = other.matrix @ self.offset + (0.0 if offset is None else offset)
        return Columns(
            f"{self.fault}, {other.fault}", f"{self.what}, and {other.what}", other.matrix @ self.matrix,
            self.rare or other.rare, offset, of=(self, other), in_room=self.in_room or other.in_room,
        )


def innocent(columns: int) -> list[Columns]:
    """The two readings of a channel that accuse nobody."""
    unit = np.eye(columns)
    return [Columns("", "as given", unit), Columns("", UNRELATED, unit, related=0.0)]


def pairs(singles: Sequence[Columns]) -> list[Columns]:
    """All readings of two mistakes at once, of different faults, but for those that are rare by themselves.

    Units are undone first. Beside axes of the room the order of others would matter.
    """
    usual = sorted((one for one in singles if one.fault and not one.rare), key=lambda one: one.fault != "wrong_unit")
    return [
        one.then(other) for one, other in combinations(usual, 2)
        if one.fault != other.fault and (one.fault == "wrong_unit" or not (one.in_room or other.in_room))
    ]


def torque_columns(wheels: int, in_si: bool = True, times: float = 1.0) -> list[Columns]:
    """All readings of the torques of so many wheels, that as given first.

    in_si: whether torques and angles should be in N m and rad; else only their ratio is known. times: how many times as
    large as the wheels say they seem to be; what a motor, a mass or an inertia may be off by is no other unit.
    """
    unit = np.eye(wheels)
    found = [*innocent(wheels), Columns("torque_sign", "all torques of the other sense", -unit)]
    for i in range(wheels):
        sign = np.ones(wheels)
        sign[i] = -1.0
        found.append(Columns("torque_sign", f"the torque of wheel {i + 1} of the other sense", np.diag(sign)))
    for order in permutations(range(wheels)) if wheels <= 5 else ():
        moved = sum(k != i for i, k in enumerate(order))
        if moved:
            said = ", ".join(str(k + 1) for k in order)
            found.append(Columns("torques_swapped", f"the torques in the order {said}", unit[list(order)], moved > 2))
    if not in_si:
        ratios = {ratio for factor in (*TORQUES.values(), *ANGLES.values()) for ratio in (factor, 1.0 / factor)}
        if times > 0.0 and abs(np.log(times)) > np.log(1.0 + UNKNOWN_INERTIA.most):
            ratios.add(1.0 / times)
        for factor in sorted(ratios):
            said = f"{1.0 / factor:.3g} times too large" if factor < 1.0 else f"{factor:.3g} times too small"
            found.append(Columns("wrong_unit", f"torques {said} beside the wheels' angles", factor * unit))
        return found
    for factor in sorted(set(TORQUES.values())):
        names = " or ".join(name for name, value in TORQUES.items() if value == factor)
        found.append(Columns("wrong_unit", f"torques in {names}", factor * unit))
    if times > _MOTORS or 0.0 < times < 1.0 / _MOTORS:
        said = f"{times:.2g} times too large" if times > 1.0 else f"{1.0 / times:.2g} times too small"
        found.append(Columns("wrong_unit", f"torques {said}, such as currents, or before a gear", unit / times, True))
    return found


def command_columns(
    measured: Sequence[tuple[float | None, float | None]] = (), rooms_rad: Sequence[float] = ()
) -> list[Columns]:
    """All readings of the columns vx, vy, wz, that as given first.

    measured: how many times as large as the wheels say vx, vy and wz are, as of `ratios`. rooms_rad: by
    which the axes of a room that vx, vy may be along are turned against the camera's; empty: no camera sees headings.

    Some accuse nobody, as the turns of a command that hardly turns say nothing of wheels that wander: without these any
    larger unit would be the likelier.
    """
    found = [
        *innocent(3), Columns("", "whatever the turns", np.eye(3), related=(1.0, 1.0, 0.0)),
        Columns("", "whatever the way", np.eye(3), related=(0.0, 0.0, 1.0)),
    ]
    for signs in product((1.0, -1.0), repeat=3):
        wrong = [name for name, sign in zip(("vx", "vy", "wz"), signs, strict=True) if sign < 0.0]
        if wrong:
            said = f"{' and '.join(wrong)} of the other sense"
            found.append(Columns("command_sign", said, np.diag(signs), len(wrong) > 1))
    for x, y in product((1.0, -1.0), repeat=2):
        swap = np.array([[0.0, x, 0.0], [y, 0.0, 0.0], [0.0, 0.0, 1.0]])
        found.append(Columns("command_axes_swapped", "vx and vy change places", swap, not x == y == 1.0))
    found += [_in_room(turn_rad) for turn_rad in rooms_rad]
    speeds = {f"{unit}/s": factor for unit, factor in LENGTHS.items()} | {"km/h": in_si("km/h")}
    ways = scales([way for way, _ in measured], "m/s", speeds)
    for way, turn in product(ways, scales([turn for _, turn in measured], "rad/s", RATES)):
        wrong = [f"{names} {scale.what}" for names, scale in (("vx, vy", way), ("wz", turn)) if scale.what]
        if wrong:
            factors = np.diag([way.factor, way.factor, turn.factor])
            advice = way.advice or turn.advice
            found.append(Columns("wrong_unit", " and ".join(wrong), factors, len(wrong) > 1, advice=advice))
    return found


def _in_room(turn_rad):
    """vx, vy along the axes of the camera's room, or of one that is turned against it, as a planner's may be."""
    said, c, s = "vx and vy along the axes of the room", np.cos(turn_rad), np.sin(turn_rad)
    said += f", turned by {np.rad2deg(turn_rad):.0f} degrees against the camera's" if turn_rad else ""
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Columns("command_in_room_frame", said, turn, bool(turn_rad), shared=True, in_room=True)


def accelerometer_columns() -> list[Columns]:
    """All mistaken readings of ax, ay, az."""
    found = _turned("ax, ay, az")
    for name, factor in (("g", GRAVITY), ("thousandths of g", GRAVITY / 1000.0), ("mm/s^2", in_si("mm/s^2"))):
        found.append(Columns("wrong_unit", f"ax, ay, az in {name}", factor * np.eye(3)))
    found.append(Columns("gravity_missing", "gravity is taken off az", np.eye(3), offset=np.array([0.0, 0.0, GRAVITY])))
    return found


def gyro_columns(measured: Sequence[float | None]) -> list[Columns]:
    """All mistaken readings of wx, wy, wz; measured: of each run, as of `gyro_rates.ratios`.

    They are in such units only as some run may be in. A ratio that no unit explains is a scale by itself.
    """
    found, unknown = _turned("wx, wy, wz"), not measured or None in measured
    found += [
        Columns("wrong_unit", f"wx, wy, wz in {name}", factor * np.eye(3)) for name, factor in RATES.items()
        if unknown or any(is_unit(ratio * factor) for ratio in measured)
    ]
    found += [
        Columns("gyro_off", f"wx, wy, wz {ratio:.3g} times as fast as the camera says", np.eye(3) / ratio)
        for ratio in gyro_scales(measured, RATES.values())
    ]
    return found


def _turned(names):
    """Every order and sign of three axes but the right one."""
    columns, found = names.split(", "), []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.diag(signs) @ np.eye(3)[list(order)]
            said = ", ".join(("-" if s < 0 else "") + columns[k] for k, s in zip(order, signs, strict=True))
            wrong = sum(s < 0 for s in signs) + sum(k != i for i, k in enumerate(order))
            if wrong:
                found.append(Columns("imu_axes", f"axes are {said}", matrix, wrong > 2))
    return found
