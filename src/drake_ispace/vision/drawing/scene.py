"""The things in the room that a renderer draws: boxes with coloured squares on their tops, and the carpet."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.robots.library import robots
from drake_ispace.room.room import Space

BGR = tuple[float, float, float]

#: Paint of the markers in full light, blue, green and red of 255.
PAINTS: dict[str, BGR] = {
    "red": (30.0, 20.0, 200.0), "blue": (200.0, 90.0, 20.0), "yellow": (20.0, 190.0, 210.0),
    "green": (60.0, 170.0, 20.0), "orange": (20.0, 110.0, 230.0), "purple": (160.0, 40.0, 110.0),
}
_PLATE: BGR = (38.0, 36.0, 34.0)
_OBSTACLE: BGR = (120.0, 150.0, 165.0)
CARPET: BGR = (118.0, 112.0, 108.0)
_AROUND = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])


@dataclass(frozen=True)
class Patch:
    """A painted rectangle on the top of a box, in the box's frame: middle and sides [m]."""

    x_m: float
    y_m: float
    length_m: float
    width_m: float
    colour: BGR


@dataclass(frozen=True)
class Box:
    """A box: middle of its footprint in W [m], yaw [rad], sides along its own x and y, bottom and top [m].

    It stands upright, or has pitched forward by `pitch_rad` about its own y axis at the height `axle_m`.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    top_m: float
    colour: BGR = _OBSTACLE
    bottom_m: float = 0.0
    patches: tuple[Patch, ...] = ()
    pitch_rad: float = 0.0
    axle_m: float = 0.0

    def into(self, directions: np.ndarray) -> np.ndarray:
        """(..., 3) directions in W as the box's own x, y, z."""
        x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, y = c * x + s * y, -s * x + c * y
        if self.pitch_rad:
            c, s = np.cos(self.pitch_rad), np.sin(self.pitch_rad)
            x, z = c * x - s * z, s * x + c * z
        return np.stack([x, y, z], axis=-1)

    def own(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) points in W [m] in the box's axes, from the middle of its footprint."""
        axle = np.array([0.0, 0.0, self.axle_m], points.dtype)
        return self.into(points - np.array([self.x_m, self.y_m, self.axle_m], points.dtype)) + axle

    def corners(self, margin_m: float = 0.0) -> np.ndarray:
        """(8, 3) corners in W [m], the sides longer by `margin_m` at each end."""
        half = np.array([self.length_m, self.width_m]) / 2.0 + margin_m
        own = np.array([[x, y, z] for z in (self.bottom_m, self.top_m) for x, y in half * _AROUND])
        axes = self.into(np.eye(3))  # its rows: the room's axes in the box's
        return (own - [0.0, 0.0, self.axle_m]) @ axes.T + [self.x_m, self.y_m, self.axle_m]

    def at(self, x_m: float, y_m: float, yaw_rad: float) -> "Box":
        return replace(self, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)

    def footprint(self, margin_m: float = 0.0) -> np.ndarray:
        """(4, 2) corners in W [m]."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        corner = np.array([self.length_m / 2.0 + margin_m, self.width_m / 2.0 + margin_m])
        corners = _AROUND * corner
        return corners @ np.array([[c, s], [-s, c]]) + [self.x_m, self.y_m]


def robot_box(name: str, space: Space, pose=(0.0, 0.0, 0.0), tilt_rad: float = 0.0, axle_m: float = 0.0) -> Box:
    """The robot called `name` at `pose` (x, y [m], phi [rad]): a dark box with its two markers on top.

    It has tilted forward by `tilt_rad` about an axle at the height `axle_m`.
    """
    markers, spacing = space.markers, space.localizer.marker_spacing_m
    front, rear = (PAINTS[colour] for colour in robots()[name].colours)
    patches = tuple(
        Patch(x, 0.0, markers.side_m, markers.side_m, colour)
        for x, colour in ((spacing / 2.0, front), (-spacing / 2.0, rear))
    )
    height = marker_height(name, space)
    return Box(
        *map(float, pose), markers.plate_m, markers.plate_m, height, _PLATE, patches=patches, pitch_rad=float(tilt_rad),
        axle_m=axle_m,
    )


def marker_height(name: str, space: Space) -> float:
    """The height of the robot's markers above the floor [m]."""
    return getattr(space.markers, f"{name}_height_m")


def obstacles(space: Space) -> tuple[Box, ...]:
    """The boxes of `space.scenery.obstacles`.

    Raises:
        InputError: a box without its six numbers or without size.
    """
    boxes = []
    for i, numbers in enumerate(space.scenery.obstacles):
        if len(numbers) != 6 or min(numbers[3:]) <= 0.0:
            raise InputError(
                f"space.scenery.obstacles[{i}]: expected x, y, yaw, length, width, height with positive sizes, got "
                f"{numbers}"
            )
        boxes.append(Box(*numbers))
    return tuple(boxes)


class Carpet:
    """Brightness of the floor: a texture of 5.12 x 5.12 m around the middle, 5 mm fine, the same for the same seed."""

    _CELLS, _CELL_M = 1024, 0.005

    def __init__(self, contrast: float, seed: int):
        rng = np.random.default_rng([seed, 5])
        fine = cv2.GaussianBlur(rng.standard_normal((self._CELLS, self._CELLS)).astype(np.float32), (0, 0), 1.2)
        coarse = cv2.GaussianBlur(rng.standard_normal((self._CELLS, self._CELLS)).astype(np.float32), (0, 0), 20.0)
        self._texture = contrast * (0.8 * fine / fine.std() + 0.6 * coarse / coarse.std())

    def grey(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The texture of the carpet, added to its mean colour, at the 2-D arrays x, y [m], in grey levels."""
        column = np.mod(x / self._CELL_M + self._CELLS / 2, self._CELLS).astype(np.float32)
        row = np.mod(y / self._CELL_M + self._CELLS / 2, self._CELLS).astype(np.float32)
        return cv2.remap(self._texture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
