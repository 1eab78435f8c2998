"""Robots in a top view: thresholds in HSV, moments of each blob, poses from pairs of blobs; section 5.3.1.

A robot that is not there, hidden, cut by the border or not told apart is None, never a guess.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from drake_ispace.vision.top_view import TopView

_AROUND = 2  # pixels beside a blob that may be mixed with its colour
_GREY = 0.15  # of a blob's colour: less may be noise
_LEAST_SATURATION, _LEAST_VALUE = 30.0, 20.0  # of a mixed pixel, else its hue is noise


@dataclass(frozen=True)
class Colour:
    """A range of OpenCV's HSV: hue 0 to 180 (half degrees, from `hue[0]` upward to `hue[1]`, through 180 if need be),
    least and most saturation and brightness of 255."""

    hue: tuple[float, float]
    saturation: float
    value: float
    most_saturation: float = 255.0
    most_value: float = 255.0

    def mask(self, hsv: np.ndarray) -> np.ndarray:
        """(rows, columns) uint8, 255 where an HSV image has this colour."""
        low, high = self.hue
        parts = [(low, high)] if low <= high else [(low, 180.0), (0.0, high)]
        most = self.most_saturation, self.most_value
        masks = [cv2.inRange(hsv, (a, self.saturation, self.value), (b, *most)) for a, b in parts]
        return masks[0] if len(masks) == 1 else cv2.bitwise_or(*masks)


@dataclass(frozen=True)
class Target:
    """A robot to look for: its colours, and what its markers measure.

    Attributes:
        front, rear: names of colours; spacing_m: between both middles, within tolerance_m; area_m2: least and largest
            of a marker; elongation: largest ratio of a blob's principal axes.
    """

    name: str
    front: str
    rear: str
    spacing_m: float
    tolerance_m: float
    area_m2: tuple[float, float]
    elongation: float = 1.12


@dataclass(frozen=True)
class Blob:
    """A connected region of one colour: middle in the top view [pixels] and in W [m], area [m^2], ratio of axes."""

    pixel: np.ndarray
    place: np.ndarray
    area_m2: float
    elongation: float


@dataclass(frozen=True)
class Sighting:
    """A robot's pose x, y [m], phi [rad] in W, and its middle in the picture that was searched [pixels]."""

    x: float
    y: float
    phi: float
    pixel: np.ndarray


def blobs(
    mask: np.ndarray, top: TopView, least_m2: float, most_m2: float, reach: np.ndarray | None = None,
    share: np.ndarray | None = None,
) -> list[Blob]:
    """The blobs of a mask with an area between the limits.

    Args:
        share: (rows, columns) how much of its colour each pixel has, to weigh the pixels of a blob and those around it.
        reach: where the camera's image ends within the top view; a blob that touches this border, or that of the top
            view, is cut and left away.
    """
    count, labels, stats, middles = cv2.connectedComponentsWithStats(mask, connectivity=8)
    unit = top.pixel_m[0] * top.pixel_m[1]
    rows, columns = mask.shape
    found = []
    for i in range(1, count):
        left, above, width, height, pixels = stats[i]
        if not least_m2 <= pixels * unit <= most_m2:
            continue
        if left == 0 or above == 0 or left + width == columns or above + height == rows:
            continue
        first_row, first_column = max(above - _AROUND, 0), max(left - _AROUND, 0)
        around = (slice(first_row, above + height + _AROUND), slice(first_column, left + width + _AROUND))
        if reach is not None and not reach[around].all():
            continue
        window = labels[around] == i
        moments = cv2.moments(window.astype(np.uint8), binaryImage=True)
        a, b, c = moments["mu20"] * top.pixel_m[0] ** 2, moments["mu02"] * top.pixel_m[1] ** 2, moments["mu11"] * unit
        root = np.hypot(a - b, 2.0 * c)
        elongation = np.sqrt((a + b + root) / max(a + b - root, 1e-12))
        middle = middles[i]
        if share is not None:
            middle = _weighted_middle(window, share[around]) + [first_column, first_row]
        found.append(Blob(middle, top.to_metres(middle)[0], pixels * unit, elongation))
    return found


def _weighted_middle(window, share):
    """(2,) u, v of a blob, by the colour of its pixels and of those around it: edges that run along rows or columns
    would else jump by whole pixels."""
    near = cv2.dilate(window.astype(np.uint8), np.ones((2 * _AROUND + 1,) * 2, np.uint8)) > 0
    weight = np.where(near, np.clip(share - _GREY * np.median(share[window]), 0.0, None), 0.0)
    if not weight.any():  # a grey blob of a scene that takes grey for a colour
        weight = window.astype(float)
    v, u = np.indices(window.shape)
    return np.array([(weight * u).sum(), (weight * v).sum()]) / weight.sum()


def find_robots(
    image: np.ndarray, top: TopView, colours: Mapping[str, Colour], targets: Sequence[Target],
    reach: np.ndarray | None = None,
) -> dict[str, Sighting | None]:
    """The pose of each target in a top view (rows, columns, 3), blue, green, red; None where it is not seen.

    A robot is seen where exactly one pair of blobs of its two colours has its spacing. Two such pairs, or a blob
    that is shared by two robots, tell nothing.
    """
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    chroma = hsv[..., 1].astype(np.float32) * hsv[..., 2] / 255.0  # a grey pixel has none, a mixed one its share
    found: dict[str, list[Blob]] = {}
    least, most = min(t.area_m2[0] for t in targets), max(t.area_m2[1] for t in targets)
    for name in {colour for target in targets for colour in (target.front, target.rear)}:
        colour = colours[name]
        hue = Colour(colour.hue, _LEAST_SATURATION, _LEAST_VALUE).mask(hsv)
        found[name] = blobs(colour.mask(hsv), top, least, most, reach, np.where(hue > 0, chroma, 0.0))
    pairs = {target.name: _pairs(target, found) for target in targets}
    used = [id(blob) for candidates in pairs.values() for pair in candidates for blob in pair]
    sightings = {}
    for name, candidates in pairs.items():
        clear = len(candidates) == 1 and all(used.count(id(blob)) == 1 for blob in candidates[0])
        sightings[name] = _sighting(*candidates[0]) if clear else None
    return sightings


def _pairs(target, found):
    fits = {
        colour: [b for b in found[colour] if target.area_m2[0] <= b.area_m2 <= target.area_m2[1]
                 and b.elongation <= target.elongation]
        for colour in (target.front, target.rear)
    }
    return [
        (front, rear) for front in fits[target.front] for rear in fits[target.rear]
        if front is not rear and abs(np.hypot(*(front.place - rear.place)) - target.spacing_m) <= target.tolerance_m
    ]


def _sighting(front, rear):
    x, y = (front.place + rear.place) / 2.0
    dx, dy = front.place - rear.place
    return Sighting(float(x), float(y), float(np.arctan2(dy, dx)), (front.pixel + rear.pixel) / 2.0)
