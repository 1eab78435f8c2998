"""The room in perspective: colour and depth images by casting rays, with NumPy and OpenCV alone.

A pixel is the mean of 3 x 3 rays, spread over its area and, for moving robots, over the time of exposure. What does
not move is drawn once; around each robot the rays are cast again.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.room.room import Scenery
from drake_ispace.vision.drawing.scene import CARPET, Box, Carpet
from drake_ispace.vision.optics.camera import View

_MOST_PIXELS = 4e6
_RAYS = 3  # per side of a pixel
_LIGHT = np.array([0.35, -0.25, 1.0]) / np.linalg.norm([0.35, -0.25, 1.0])  # towards the lamp
_SIDE_LIGHT = 0.6  # of the faces that stand upright
#: The order in which the rays of a pixel meet the times of exposure: mixed, or motion would look like a shift.
_TIMES = (np.array([4, 0, 8, 2, 6, 1, 5, 7, 3]) - 4.0) / 9.0


@dataclass(frozen=True)
class Picture:
    """colour: (rows, columns, 3) blue, green, red; depth: (rows, columns) along the view [m], 0 where nothing is."""

    colour: np.ndarray
    depth: np.ndarray


def hit(box: Box, origin: np.ndarray, rays: np.ndarray, least: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    """Where rays meet a box.

    Args:
        origin: (3,) or (..., 3) in W [m]; rays: (..., 3) directions in W; least: of the distance.

    Returns:
        (...) distance in lengths of the rays, inf where there is none, and (...) whether the top face is met.
    """
    start, way = box.own(np.asarray(origin)), box.into(np.asarray(rays))
    sides = np.array([
        [-box.length_m / 2.0, box.length_m / 2.0], [-box.width_m / 2.0, box.width_m / 2.0], [box.bottom_m, box.top_m],
    ])
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far, top = -np.inf, np.inf, None
        for axis, (low, high) in enumerate(sides):
            inverse = 1.0 / way[..., axis]
            one, two = (low - start[..., axis]) * inverse, (high - start[..., axis]) * inverse
            top = np.minimum(one, two)
            near, far = np.maximum(near, top), np.minimum(far, np.maximum(one, two))
        met = (near <= far) & (near > least)
    return np.where(met, near, np.inf), met & (near == top)


def shaded(box: Box, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """(...) whether rays from within or outside of a box pass through it."""
    distance, _ = hit(box, origin, rays, 1e-6)
    return np.isfinite(distance)


class Renderer:
    """Draws boxes on the carpet as a View sees them.

    Args:
        view: the camera; scenery: light, carpet and noise; static: boxes that do not move; width_m: of the space, for
            the light gradient; seed: of carpet and noise.

    Raises:
        InputError: a camera with more pixels than fit into memory.
    """

    def __init__(self, view: View, scenery: Scenery, static: tuple[Box, ...] = (), width_m: float = 2.5, seed: int = 0):
        if view.size[0] * view.size[1] > _MOST_PIXELS:
            raise InputError(
                f"space.camera.size_pixels: expected at most {_MOST_PIXELS:g} pixels to render, got {view.size}"
            )
        self.view, self.static, self._scenery, self._seed = view, static, scenery, seed
        self._carpet = Carpet(scenery.carpet_contrast, seed)
        self._gradient = scenery.light_gradient / width_m
        columns, rows = view.size
        steps = (np.arange(_RAYS) + 0.5) / _RAYS - 0.5
        self._rays = [
            view.rays(view.pixel_grid((u, v))).reshape(rows, columns, 3).astype(np.float32)
            for v in steps
            for u in steps
        ]
        whole = (slice(0, rows), slice(0, columns))
        self._static_windows = [self._window(box) for box in static]
        self._background = self._cast(whole, [list(static)] * len(self._rays))

    def draw(self, moving=(), moved=()) -> Picture:
        """A picture without noise.

        Args:
            moving: boxes at the middle of the exposure; moved: (dx, dy [m], dphi [rad]) of each during it.
        """
        colour, depth = self._background[0].copy(), self._background[1].copy()
        moving = list(moving)
        moved = list(moved) or [(0.0, 0.0, 0.0)] * len(moving)
        scenes = [
            [*self.static, *(
                box.at(box.x_m + t * dx, box.y_m + t * dy, box.yaw_rad + t * dphi)
                for box, (dx, dy, dphi) in zip(moving, moved, strict=True)
            )] for t in _TIMES
        ]
        windows = [*self._static_windows, *map(self._window, moving)]
        for window in windows[len(self.static) :]:
            if window is not None:
                near = [i for i, other in enumerate(windows) if other is not None and _overlap(window, other)]
                colour[window], depth[window] = self._cast(window, [[scene[i] for i in near] for scene in scenes])
        return Picture(colour, depth)

    def render(self, moving=(), moved=(), tick: int = 0) -> Picture:
        """A picture as the sensor gives it: 8-bit colour and depth, with the noise of `tick`."""
        return with_noise(self.draw(moving, moved), self._scenery, self._seed, tick)

    def _window(self, box):
        """The rows and columns that the box, its shadow and its motion can change; None outside of the image."""
        corners = box.corners(0.02)
        shadow = corners - corners[:, 2:] * _LIGHT / _LIGHT[2]
        pixels = self.view.project(np.vstack([corners, shadow]))
        columns, rows = self.view.size
        if np.isnan(pixels).any():
            return slice(0, rows), slice(0, columns)
        low = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 2, 0)
        high = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + 3, [columns, rows])
        return None if (low >= high).any() else (slice(low[1], high[1]), slice(low[0], high[0]))

    def _cast(self, window, scenes):
        colour, depth = 0.0, None
        for i, (rays, boxes) in enumerate(zip(self._rays, scenes, strict=True)):
            one, distance = self._look(rays[window], boxes)
            colour = colour + one
            if i == len(self._rays) // 2:  # the ray through the middle of the pixel
                depth = distance
        return colour / len(self._rays), depth

    def _look(self, rays, boxes):
        """Colour and z-depth of one ray each."""
        origin = self.view.p_ws.astype(np.float32)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -origin[2] / rays[..., 2]
        distance[~(distance > 0.0)] = np.inf
        seen, reached = np.isfinite(distance), []
        for box in boxes:
            far, top = hit(box, origin, rays)
            nearer = far < distance
            distance = np.where(nearer, far, distance)
            reached.append((box, nearer, top))
        point = origin + np.where(seen, distance, 1.0)[..., None] * rays
        colour = np.asarray(CARPET, np.float32) + self._carpet.grey(point[..., 0], point[..., 1])[..., None]
        for box, nearer, top in reached:
            if nearer.any():
                colour[nearer] = _paint(box, point[nearer], top[nearer])
        light = 1.0 + self._gradient * point[..., 0]
        lit = np.ones(distance.shape, bool)
        for box in boxes:
            lit &= ~shaded(box, point + 1e-4 * _LIGHT.astype(np.float32), _LIGHT.astype(np.float32))
        light = np.clip(light * np.where(lit, 1.0, 1.0 - self._scenery.shadow), 0.0, None)
        colour = np.where(seen[..., None], colour * light[..., None], 0.0)
        return colour, np.where(seen, distance, 0.0).astype(np.float32)


def _overlap(one, other):
    return all(a.start < b.stop and b.start < a.stop for a, b in zip(one, other, strict=True))


def _paint(box, points, top):
    """(n, 3) colours of (n, 3) points on a box."""
    colour = np.tile(np.asarray(box.colour, np.float32), (len(points), 1))
    colour[~top] *= _SIDE_LIGHT
    x, y, _ = box.own(points).T
    for patch in box.patches:
        inside = top & (np.abs(x - patch.x_m) <= patch.length_m / 2.0) & (np.abs(y - patch.y_m) <= patch.width_m / 2.0)
        colour[inside] = patch.colour
    return colour


def with_noise(picture: Picture, scenery: Scenery, seed: int, tick: int) -> Picture:
    """The picture as a sensor gives it, with the noise of (seed, tick): colours in whole grey levels, the variance of
    their noise growing with the light, that of depth with its fourth power; Bayer pattern and JPEG as the scenery says.
    """
    rng = np.random.default_rng([seed, tick, 11])
    colour, depth = picture.colour.astype(np.float32), picture.depth
    dark, bright = scenery.noise_grey_levels, scenery.light_noise_grey_levels
    if dark > 0.0 or bright > 0.0:
        spread = np.sqrt(dark**2 + bright**2 * np.clip(colour, 0.0, 255.0) / 255.0, dtype=np.float32)
        colour = colour + spread * rng.standard_normal(colour.shape, dtype=np.float32)
    if scenery.depth_noise_m > 0.0:
        depth = depth + scenery.depth_noise_m * depth**2 * rng.standard_normal(depth.shape, dtype=np.float32)
    levels = np.clip(np.rint(colour), 0, 255).astype(np.uint8)
    if scenery.bayer:
        levels = _through_bayer(levels)
    if scenery.jpeg_quality is not None:
        _, packed = cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, scenery.jpeg_quality])
        levels = cv2.imdecode(packed, cv2.IMREAD_COLOR)
    return Picture(levels, depth)


def _through_bayer(levels):
    """The picture of a sensor each of whose pixels sees one colour: red and green in even rows, green and blue in odd
    ones; the others are interpolated."""
    seen = np.empty(levels.shape[:2], np.uint8)
    for row, column, colour in ((0, 0, 2), (0, 1, 1), (1, 0, 1), (1, 1, 0)):
        seen[row::2, column::2] = levels[row::2, column::2, colour]
    return cv2.cvtColor(seen, cv2.COLOR_BayerRGGB2BGR)
