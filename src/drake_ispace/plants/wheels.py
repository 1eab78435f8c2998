"""Wheel geometry of any planar robot, with its forward and inverse kinematics.

A wheel at p_BW = (x, y) drives its contact point along the direction `drive` (angle from the body's x axis). The
floor holds the contact point only along the roller's axis. For a plain wheel or a 90 degree roller this axis is the
drive direction itself; for a mecanum wheel the angle between the two is `roller`. Hence

    radius * theta_dot = (v_B + wz x p_BW) . (cos(drive + roller), sin(drive + roller)) / cos(roller)

The equations of all wheels together are theta_dot = G v_B with v_B = [vx, vy, wz], the inverse of v = J theta_dot,
(2.64).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg import null_space


@dataclass(frozen=True)
class Wheel:
    """One wheel: contact point (x_m, y_m) in B [m], drive direction and roller angle [rad], radius [m].

    `holds_sideways`: a plain tyre, which cannot move across its drive direction (no rollers).
    """

    x_m: float
    y_m: float
    drive_rad: float
    radius_m: float
    roller_rad: float = 0.0
    holds_sideways: bool = False

    def row(self) -> np.ndarray:
        """Return the wheel's row of G (3,): wheel speed [rad/s] per body velocity [m/s, m/s, rad/s] in B."""
        hold = self.drive_rad + self.roller_rad
        x, y = np.cos(hold), np.sin(hold)
        return np.array([x, y, self.x_m * y - self.y_m * x]) / (self.radius_m * np.cos(self.roller_rad))


@dataclass(frozen=True)
class WheelGeometry:
    """A robot's wheels; `inverse` is G (n, 3), `forward` its left inverse (3, n), both read-only.

    Raises:
        ValueError: there is no wheel, a radius is not positive, a roller lies along its wheel's axle, tyres hold every
            motion, or a direction of motion neither turns a wheel nor is held by one: the rows of `inverse` and
            `sideways` have rank below 3.
    """

    wheels: tuple[Wheel, ...]

    def __post_init__(self):
        if not self.wheels:
            raise ValueError("a wheel geometry needs at least one wheel")
        for number, wheel in enumerate(self.wheels, 1):
            if not wheel.radius_m > 0.0:
                raise ValueError(f"wheel {number}: radius_m is {wheel.radius_m}, expected a positive length")
            if abs(np.cos(wheel.roller_rad)) < 1e-6:
                raise ValueError(f"wheel {number}: roller_rad is {wheel.roller_rad}, the roller lies along the axle")
        if len(self.sideways) and np.linalg.matrix_rank(self.sideways, tol=1e-9) == 3:
            raise ValueError("these tyres hold every motion, expected parallel ones")
        if np.linalg.matrix_rank(np.vstack([self.inverse, self.sideways]), tol=1e-9) < 3:
            raise ValueError("these wheels leave a direction of motion unseen, expected three independent rows")

    @cached_property
    def inverse(self) -> np.ndarray:
        """G (n, 3): theta_dot [rad/s] = G v_B."""
        return _read_only(np.array([wheel.row() for wheel in self.wheels]))

    @property
    def holds_sideways(self) -> bool:
        """Whether some tyre holds the robot, so that it cannot move sideways."""
        return any(wheel.holds_sideways for wheel in self.wheels)

    @property
    def sideways(self) -> np.ndarray:
        """Rows (k, 3) whose product with v_B is zero, one for each of the k wheels that hold sideways."""
        rows = [
            [-np.sin(w.drive_rad), np.cos(w.drive_rad), w.x_m * np.cos(w.drive_rad) + w.y_m * np.sin(w.drive_rad)]
            for w in self.wheels if w.holds_sideways
        ]
        return np.array(rows).reshape(-1, 3)

    @property
    def holds_turns(self) -> bool:
        """Whether the tyres hold the robot, so that it cannot turn unless they skid."""
        held, with_turning = (
            np.linalg.matrix_rank(np.vstack([self.sideways, [0.0, 0.0, turning]]), tol=1e-9) for turning in (0.0, 1.0)
        )
        return bool(held == with_turning)

    @cached_property
    def forward(self) -> np.ndarray:
        """J in frame B (3, n), (2.66): v_B = J theta_dot is the least-squares solution with `sideways` v_B = 0."""
        free = null_space(self.sideways) if len(self.sideways) else np.eye(3)
        return _read_only(free @ np.linalg.pinv(self.inverse @ free))


def _read_only(array):
    array.flags.writeable = False
    return array


def omni4(radius_m: float, wheel_distance_m: float) -> WheelGeometry:
    """Return the wheels of the thesis's robot, (2.66): 1 to 4 at 0, 90, 180, 270 degrees, each driving tangentially.

    `wheel_distance_m` is b of Table 2.2, the full distance between opposite wheels.
    """
    return ring(4, radius_m, wheel_distance_m / 2.0, first_rad=0.0)


def omni3(radius_m: float, centre_distance_m: float, first_rad: float = np.pi / 3.0) -> WheelGeometry:
    """Return three omni wheels, 120 degrees apart, `centre_distance_m` from the centre, the first at `first_rad`."""
    return ring(3, radius_m, centre_distance_m, first_rad)


@lru_cache
def ring(count: int, radius_m: float, centre_distance_m: float, first_rad: float) -> WheelGeometry:
    """Return `count` tangential omni wheels, evenly spaced anticlockwise around the centre from `first_rad`."""
    angles = first_rad + 2.0 * np.pi * np.arange(count) / count
    return WheelGeometry(tuple(
        Wheel(centre_distance_m * np.cos(a), centre_distance_m * np.sin(a), a + np.pi / 2.0, radius_m) for a in angles
    ))


def mecanum(radius_m: float, half_length_m: float, half_width_m: float) -> WheelGeometry:
    """Return four mecanum wheels: front left, front right, rear left, rear right.

    The wheels drive along x and their rollers lie at 45 degrees.
    """
    a, b, quarter = half_length_m, half_width_m, np.pi / 4.0
    return WheelGeometry((
        Wheel(a, b, 0.0, radius_m, -quarter), Wheel(a, -b, 0.0, radius_m, quarter),
        Wheel(-a, b, 0.0, radius_m, quarter), Wheel(-a, -b, 0.0, radius_m, -quarter),
    ))


def rescaled(geometry: WheelGeometry, radius_shares: Sequence[float]) -> WheelGeometry:
    """Return the wheels of `geometry` with each radius multiplied by 1 + its share.

    Raises:
        ValueError: the number of shares is not that of the wheels, or a radius is no longer positive.
    """
    pairs = list(zip(geometry.wheels, radius_shares, strict=True))
    if not any(radius_shares):
        return geometry
    return WheelGeometry(tuple(replace(wheel, radius_m=wheel.radius_m * (1.0 + share)) for wheel, share in pairs))


def toed(geometry: WheelGeometry, angles_rad: Sequence[float]) -> WheelGeometry:
    """Return the wheels of `geometry` with each drive direction turned by its angle, anticlockwise.

    Raises:
        ValueError: the number of angles is not that of the wheels, or a direction of motion is no longer seen.
    """
    pairs = list(zip(geometry.wheels, angles_rad, strict=True))
    if not any(angles_rad):
        return geometry
    return WheelGeometry(tuple(replace(wheel, drive_rad=wheel.drive_rad + angle) for wheel, angle in pairs))


def skidding(geometry: WheelGeometry) -> WheelGeometry:
    """Return the wheels as they roll where tyres that hold turns skid: in one line across, through their middle.

    A tyre that is moved along its drive direction rolls as before. As given where tyres hold no turns, or would come to
    stand in one place, as those of a bicycle, which turns by steering.
    """
    if not geometry.holds_turns:
        return geometry
    middle = np.mean([[wheel.x_m, wheel.y_m] for wheel in geometry.wheels if wheel.holds_sideways], axis=0)
    wheels = tuple(_beside(wheel, *middle) if wheel.holds_sideways else wheel for wheel in geometry.wheels)
    try:
        return WheelGeometry(wheels)
    except ValueError:  # nothing tells of turns
        return geometry


def _beside(wheel, x_m, y_m):
    """The wheel, moved along its drive direction until it is beside a point."""
    c, s = np.cos(wheel.drive_rad), np.sin(wheel.drive_rad)
    along = (x_m - wheel.x_m) * c + (y_m - wheel.y_m) * s
    return replace(wheel, x_m=wheel.x_m + along * c, y_m=wheel.y_m + along * s)


@lru_cache
def differential(radius_m: float, half_track_m: float) -> WheelGeometry:
    """Return two plain wheels, right then left, `half_track_m` (b of (2.36)) from the centre line."""
    return WheelGeometry((
        Wheel(0.0, -half_track_m, 0.0, radius_m, holds_sideways=True),
        Wheel(0.0, half_track_m, 0.0, radius_m, holds_sideways=True),
    ))
