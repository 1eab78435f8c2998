"""Scenes learned from one picture: the colours and places of the markers that somebody points at.

A colour is what the pixels around a pointed one have in common, with room for dimmer and brighter light. Where two
colours meet, or a colour and the rest of the picture, the limit lies half-way between them.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.vision.finding.markers import Blob, Colour, find_blobs
from drake_ispace.vision.footage.scene_file import ColourRange, MarkerPlace, RobotMarkers, Scene, scene_eye, scene_top

_DIMMER, _BRIGHTER, _HUE = 0.6, 1.5, 10.0  # by how much the same paint may look elsewhere in the room
_MOST_RADIUS = 40  # pixels around a pointed one that are looked at
_CORE = 2.0, 98.0  # percentiles between which a marker's own pixels lie
_SMALLER, _LARGER = 0.7, 1.4  # than the markers of the picture
_LEAST_PIXELS = 6  # of a marker
#: First and last hue, in half degrees, of what is called so.
HUES = {
    "red": (170, 7), "orange": (8, 19), "yellow": (20, 32), "lime": (33, 51), "green": (52, 84), "cyan": (85, 99),
    "blue": (100, 129), "purple": (130, 154), "pink": (155, 169),
}


@dataclass(frozen=True)
class Pointed:
    """A marker that somebody points at: of a robot, of a colour, at a pixel u, v. A robot's first marker is its front
    one, the second its rear one."""

    robot: str
    colour: str
    pixel: tuple[float, float]


def read_pointed(texts: Sequence[str]) -> list[Pointed]:
    """Markers from texts "robot:colour:u,v".

    Raises:
        InputError: a text of another form, or a robot with one marker only.
    """
    pointed = []
    for text in texts:
        words = text.split(":")
        try:
            u, v = map(float, words[-1].split(","))
        except ValueError:
            u = v = np.nan
        if len(words) != 3 or not words[0] or not words[1] or not (np.isfinite(u) and np.isfinite(v)):
            raise InputError(f"--marker: expected robot:colour:u,v, got {shown(text)}")
        pointed.append(Pointed(words[0], words[1], (u, v)))
    for name in {one.robot for one in pointed}:
        if sum(one.robot == name for one in pointed) < 2:
            raise InputError(f"--marker: robot {shown(name)} has one marker only, expected a front and a rear one")
    return pointed


def read_heights(texts: Sequence[str]) -> dict[str, float]:
    """Robot -> height of its markers above the floor [m], from texts "robot:metres".

    Raises:
        InputError: a text of another form.
    """
    heights = {}
    for text in texts:
        name, _, number = text.rpartition(":")
        try:
            height_m = float(number)
        except ValueError:
            height_m = np.nan
        if not name or not 0.0 <= height_m <= 2.0:
            raise InputError(f"--height: expected robot:metres, 0 to 2, got {shown(text)}")
        heights[name] = height_m
    return heights


def learn(
    image: np.ndarray, scene: Scene, pointed: Sequence[Pointed], heights_m: Mapping[str, float] | None = None
) -> Scene:
    """The scene with the colours and robots that are pointed at.

    Args:
        image: (rows, columns, 3) blue, green, red. scene: its floor and camera are kept, its colours and robots not.
        heights_m: robot -> height of its markers above the floor; left out: that of a robot of this name in the scene,
            else 0.

    Raises:
        InputError: a pixel outside of the image or without a marker, colours that cannot be told apart, or robots that
            the learned scene does not find again in this picture.
    """
    rows, columns = image.shape[:2]
    for one in pointed:
        if not (0 <= one.pixel[0] < columns and 0 <= one.pixel[1] < rows):
            raise InputError(f"--marker {_text(one)}: expected a pixel within {columns} x {rows}")
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    regions = [_region(image, one.pixel, [other.pixel for other in pointed]) for one in pointed]
    samples = {
        name: hsv[np.any([r for r, one in zip(regions, pointed, strict=True) if one.colour == name], axis=0)]
        for name in dict.fromkeys(one.colour for one in pointed)
    }
    near = cv2.dilate(np.any(regions, axis=0).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    colours = limits(samples, hsv[~near])
    learned = replace(scene, colours={name: _range(colour) for name, colour in colours.items()}, robots={})
    heights = {name: robot.height_m for name, robot in scene.robots.items()} | dict(heights_m or {})
    tops = {height: scene_top(learned, height_m=height) for height in {heights.get(one.robot, 0.0) for one in pointed}}
    found = {
        height: find_blobs(top.warp(image), top, colours, (_LEAST_PIXELS * top.pixel_m[0] * top.pixel_m[1], np.inf))
        for height, top in tops.items()
    }
    blobs = [
        _pointed_blob(one, found[height][one.colour], tops[height])
        for one, height in ((one, heights.get(one.robot, 0.0)) for one in pointed)
    ]
    areas, elongations = [blob.area_m2 for blob in blobs], [blob.elongation for blob in blobs]
    robots = {
        name: replace(
            _robot([(one, blob) for one, blob in zip(pointed, blobs, strict=True) if one.robot == name]),
            height_m=heights.get(name, 0.0),
        ) for name in dict.fromkeys(one.robot for one in pointed)
    }
    gaps = [marker.x_m * 2.0 for robot in robots.values() for marker in robot.markers[:1]]
    sizes = replace(
        scene.markers, spacing_m=_rounded(np.median(gaps)), elongation=_rounded(1.2 * max(elongations)),
        tolerance_m=_rounded(max(0.1 * min(gaps), 2.0 * max(scene.pixel_m))),
        area_m2=[_rounded(_SMALLER * min(areas)), _rounded(_LARGER * max(areas))],
    )
    learned = replace(learned, markers=sizes, robots=robots)
    again = scene_eye(learned).see(image)
    lost = [names[0] for names, sightings in again if len(sightings) < len(names)]
    if lost:
        raise InputError(
            f"--marker: with what was learned, robot {shown(lost[0])} is not found again in this picture; expected "
            "markers that differ from each other and from the floor"
        )
    return learned


def coloured_blobs(image: np.ndarray) -> list[tuple[tuple[float, float], str]]:
    """Middle (u, v) and the word for its hue, of what stands out by its colour; what one might point at."""
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    chroma = (hsv[..., 1].astype(np.float32) * hsv[..., 2] / 255.0).astype(np.uint8)
    least, _ = cv2.threshold(chroma, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    found = []
    for word, hues in HUES.items():
        mask = np.where(chroma > least, Colour(hues, 0.0, 0.0).mask(hsv), 0).astype(np.uint8)
        count, _, stats, middles = cv2.connectedComponentsWithStats(mask, connectivity=8)
        found += [
            ((float(middles[i][0]), float(middles[i][1])), word)
            for i in range(1, count) if stats[i][cv2.CC_STAT_AREA] >= 2 * _LEAST_PIXELS
        ]
    return sorted(found, key=lambda blob: (blob[0][1], blob[0][0]))


def limits(samples: dict[str, np.ndarray], rest: np.ndarray) -> dict[str, Colour]:
    """A range for each colour from its pixels (n, 3) in HSV, and from the pixels (m, 3) of everything else.

    Raises:
        InputError: two colours that overlap in hue, saturation and brightness alike.
    """
    cores = {name: _core(pixels) for name, pixels in samples.items()}
    wide = {}
    for name, (hue, saturation, value) in cores.items():
        wide[name] = [
            [hue[0] - _HUE, hue[1] + _HUE], [_DIMMER * saturation[0], min(_BRIGHTER * saturation[1], 255.0)],
            [_DIMMER * value[0], min(_BRIGHTER * value[1], 255.0)],
        ]
    for one, other in itertools.combinations(cores, 2):
        _part(one, other, cores, wide)
    for name, (hue, saturation, value) in wide.items():
        alike = (_turned(rest[:, 0], hue[0]) <= hue[1] - hue[0]) & (rest[:, 2] >= value[0])
        if alike.any():
            others = np.percentile(rest[alike, 1], 99.0)
            if others < cores[name][1][0]:
                saturation[0] = max(saturation[0], (others + cores[name][1][0]) / 2.0)
    return {
        name: Colour(
            (float(round(hue[0] % 180.0)), float(round(hue[1] % 180.0))), *(float(round(limit)) for limit in (
                saturation[0], value[0], saturation[1], value[1]
            ))
        ) for name, (hue, saturation, value) in wide.items()
    }


def _part(one, other, cores, wide):
    """Cut the ranges of two colours half-way between them, where they are the furthest apart for their widths."""
    best = None
    for axis in range(3):
        (a, b), (c, d) = cores[one][axis], cores[other][axis]
        if axis == 0:  # the second hue as seen from the first, the short way round
            shift = 180.0 * np.round(((a + b) / 2.0 - (c + d) / 2.0) / 180.0)
            c, d = c + shift, d + shift
        low, high = (one, other) if a + b <= c + d else (other, one)
        gap = max(c - b, a - d)
        share = gap / (b - a + d - c + 1.0)
        if best is None or share > best[0]:
            best = share, axis, low, high, gap
    share, axis, low, high, gap = best
    if share <= 0.0:
        raise InputError(f"--marker: {one} and {other} look alike in this picture, expected one name for both")
    wide[low][axis][1] = min(wide[low][axis][1], cores[low][axis][1] + gap / 2.0)
    wide[high][axis][0] = max(wide[high][axis][0], cores[high][axis][0] - gap / 2.0)


def _core(pixels):
    """Hue, saturation and value between which most of the pixels lie; hues run upward, maybe below 0."""
    angles = pixels[:, 0] * (2.0 * np.pi / 180.0)
    middle = np.arctan2(np.sin(angles).mean(), np.cos(angles).mean()) * 180.0 / (2.0 * np.pi)
    around = (pixels[:, 0] - middle + 90.0) % 180.0 - 90.0
    hue = middle + np.percentile(around, _CORE)
    return [list(hue), list(np.percentile(pixels[:, 1], _CORE)), list(np.percentile(pixels[:, 2], _CORE))]


def _turned(hue, low):
    """Hues counted upward from `low`."""
    return (hue - low) % 180.0


def _region(image, pixel, others):
    """(rows, columns) whether a pixel belongs to the marker that is pointed at.

    What is near its colour is parted from what is not, and again, until it no longer reaches the border of a window.
    """
    u, v = (round(value) for value in pixel)
    apart = [np.hypot(pixel[0] - x, pixel[1] - y) for x, y in others if (x, y) != pixel]
    radius = int(np.clip(min(apart, default=_MOST_RADIUS), _LEAST_PIXELS, _MOST_RADIUS))
    top, left = max(v - radius, 0), max(u - radius, 0)
    window = cv2.cvtColor(image[top : v + radius + 1, left : u + radius + 1], cv2.COLOR_BGR2LAB).astype(float)
    at = v - top, u - left
    own = np.median(window[max(at[0] - 1, 0) : at[0] + 2, max(at[1] - 1, 0) : at[1] + 2].reshape(-1, 3), axis=0)
    distance = np.clip(np.linalg.norm(window - own, axis=2), 0.0, 255.0).astype(np.uint8)
    part = np.ones(distance.shape, np.uint8)
    while _reaches_border(part):
        least, _ = cv2.threshold(distance[part > 0], 0, 255, cv2.THRESH_BINARY_INV + cv2.THRESH_OTSU)
        _, labels = cv2.connectedComponents((distance <= least).astype(np.uint8), connectivity=4)
        smaller = (labels == labels[at]).astype(np.uint8)
        if smaller.sum() == part.sum() or labels[at] == 0:
            break
        part = smaller
    inner = cv2.erode(part, np.ones((3, 3), np.uint8))
    whole = np.zeros(image.shape[:2], bool)
    chosen = (inner if inner.sum() >= _LEAST_PIXELS else part) > 0
    whole[top : top + part.shape[0], left : left + part.shape[1]] = chosen
    return whole


def _reaches_border(part):
    return bool(part[0].any() or part[-1].any() or part[:, 0].any() or part[:, -1].any())


def _pointed_blob(one, blobs, top) -> Blob:
    """The blob nearest to a pointed pixel, which must lie on it."""
    (place,) = top.to_metres(top.from_image([one.pixel]))
    nearest = min(blobs, key=lambda blob: np.hypot(*(blob.place - place)), default=None)
    if nearest is None or np.hypot(*(nearest.place - place)) > np.sqrt(nearest.area_m2):
        raise InputError(f"--marker {_text(one)}: there is no coloured marker at this pixel")
    return nearest


def _robot(markers) -> RobotMarkers:
    """The markers of a robot in its own frame: middle between the first two, x from the second to the first."""
    places = np.array([blob.place for _, blob in markers])
    middle, ahead = places[:2].mean(axis=0), places[0] - places[1]
    x_axis = ahead / np.hypot(*ahead)
    own = (places - middle) @ np.column_stack([x_axis, [-x_axis[1], x_axis[0]]])
    own = np.round(own, 4) + 0.0  # no -0.0
    return RobotMarkers(markers=[
        MarkerPlace(one.colour, float(x), float(y)) for (one, _), (x, y) in zip(markers, own, strict=True)
    ])


def _range(colour: Colour) -> ColourRange:
    return ColourRange(
        list(colour.hue), colour.saturation, colour.value, colour.most_saturation, colour.most_value
    )


def _rounded(value) -> float:
    return float(f"{value:.3g}")


def _text(one):
    return f"{one.robot}:{one.colour}:{one.pixel[0]:g},{one.pixel[1]:g}"
