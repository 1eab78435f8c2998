"""Markers in a top view: thresholds in HSV, then the moments of each blob; section 5.3.1."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from drake_ispace.vision.optics.top_view import TopView

_AROUND = 2  # pixels beside a blob that may be mixed with its colour
_HALF = 0.5  # of an area: what a threshold may miss of a marker, or add to it
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
class Blob:
    """A connected region of one colour: middle in the top view [pixels] and in W [m], area [m^2], ratio of axes."""

    pixel: np.ndarray
    place: np.ndarray
    area_m2: float
    elongation: float


def blobs(
    mask: np.ndarray, top: TopView, least_m2: float, most_m2: float, reach: np.ndarray | None = None,
    share: np.ndarray | None = None,
) -> list[Blob]:
    """The blobs of a mask with an area between the limits.

    Args:
        share: (rows, columns) how much of its colour each pixel has, to weigh the pixels of a blob and those around it:
            where the edges of a marker are blurred, its area and middle stay what they are.
        reach: where the camera's image ends within the top view; a blob that touches this border, or that of the top
            view, is cut and left away.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    unit = top.pixel_m[0] * top.pixel_m[1]
    rows, columns = mask.shape
    found = []
    for i in range(1, count):
        left, above, width, height, pixels = stats[i]
        if not _HALF * least_m2 <= pixels * unit <= most_m2 / _HALF:
            continue
        if left == 0 or above == 0 or left + width == columns or above + height == rows:
            continue
        first_row, first_column = max(above - _AROUND, 0), max(left - _AROUND, 0)
        around = (slice(first_row, above + height + _AROUND), slice(first_column, left + width + _AROUND))
        if reach is not None and not reach[around].all():
            continue
        window = labels[around] == i
        weight, pixels = _weights(window, None if share is None else share[around])
        moments, area_m2 = cv2.moments(weight.astype(np.float32)), pixels * unit
        if not least_m2 <= area_m2 <= most_m2:
            continue
        a, b, c = moments["mu20"] * top.pixel_m[0] ** 2, moments["mu02"] * top.pixel_m[1] ** 2, moments["mu11"] * unit
        root = np.hypot(a - b, 2.0 * c)
        elongation = np.sqrt((a + b + root) / max(a + b - root, 1e-12))
        middle = np.array([moments["m10"], moments["m01"]]) / moments["m00"] + [first_column, first_row]
        found.append(Blob(middle, top.to_metres(middle)[0], float(area_m2), float(elongation)))
    return found


def _weights(window, share):
    """(rows, columns) weight of each pixel of a blob and of those around it, and how many pixels full of its colour
    they make: edges that run along rows or columns would else jump by whole pixels."""
    if share is not None:
        one, around = window.astype(np.uint8), np.ones((2 * _AROUND + 1,) * 2, np.uint8)
        inner = cv2.erode(one, around, borderValue=0) > 0  # without the edges, whose colour is mixed
        full = np.median(share[inner if inner.any() else window])
        if full > 0.0:
            near = np.where(cv2.dilate(one, around) > 0, share, 0.0)
            return np.clip(near - _GREY * full, 0.0, None), near[near > _GREY * full].sum() / full
    return window.astype(float), window.sum()  # also a grey blob of a scene that takes grey for a colour


def find_blobs(
    image: np.ndarray, top: TopView, colours: Mapping[str, Colour], limits_m2: tuple[float, float],
    reach: np.ndarray | None = None,
) -> dict[str, list[Blob]]:
    """The blobs of each colour in a top view (rows, columns, 3), blue, green, red, with an area between the limits."""
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    chroma = hsv[..., 1].astype(np.float32) * hsv[..., 2] / 255.0  # a grey pixel has none, a mixed one its share
    found = {}
    for name, colour in colours.items():
        hue = Colour(colour.hue, _LEAST_SATURATION, _LEAST_VALUE).mask(hsv)
        found[name] = blobs(colour.mask(hsv), top, *limits_m2, reach, np.where(hue > 0, chroma, 0.0))
    return found
