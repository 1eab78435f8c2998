"""Robots as patterns of markers: which blobs make a robot, and where it stands; section 5.3.1.

A pattern is some coloured markers at known places on a robot's top. Blobs match it if it can be turned and shifted so
that each marker falls on a blob of its colour. Of all matches those count that stand in every largest set of matches
without a common blob: a blob that two robots could share tells nothing.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.vision.finding.markers import Blob
from drake_ispace.vision.optics.top_view import TopView

_MOST_IN_CONFLICT = 20  # matches that share blobs with each other; of a larger heap none is told apart


@dataclass(frozen=True)
class Marker:
    """A patch of one colour on a robot's top: its middle in the robot's frame [m], its least and largest area [m^2]."""

    colour: str
    x_m: float
    y_m: float
    area_m2: tuple[float, float]


@dataclass(frozen=True)
class Pattern:
    """What a robot's top looks like.

    Attributes:
        markers: at least two, at different places.
        tolerance_m: largest error of the distance between two markers.
        elongation: largest ratio of a blob's principal axes.
    """

    markers: tuple[Marker, ...]
    tolerance_m: float
    elongation: float = 1.12

    @property
    def places(self) -> np.ndarray:
        """(n, 2) middles of the markers in the robot's frame [m]."""
        return np.array([(marker.x_m, marker.y_m) for marker in self.markers])

    def part_of(self, other: "Pattern") -> bool:
        """Whether this pattern can be laid on markers of the other one; on those of itself: in a second way."""
        choices = [
            [j for j, there in enumerate(other.markers) if there.colour == marker.colour] for marker in self.markers
        ]
        return any(
            len(set(chosen)) == len(chosen) and (self is not other or chosen != tuple(range(len(chosen))))
            and _laid_on(self, other.places[list(chosen)]) is not None
            for chosen in itertools.product(*choices)
        )


@dataclass(frozen=True)
class Target:
    """A robot to look for. Robots with equal patterns look alike."""

    name: str
    pattern: Pattern


def pair(
    front: str, rear: str, spacing_m: float, tolerance_m: float, area_m2: tuple[float, float], elongation: float = 1.12
) -> Pattern:
    """The pattern of two markers of equal size, before and behind the robot's middle, `spacing_m` apart."""
    half = spacing_m / 2.0
    return Pattern(
        (Marker(front, half, 0.0, area_m2), Marker(rear, -half, 0.0, area_m2)), tolerance_m, elongation
    )


@dataclass(frozen=True)
class Sighting:
    """A robot's pose x, y [m], phi [rad] in W, and its middle in the picture that was searched [pixels].

    sure: whether it can be no other robot that looks like it.
    """

    x: float
    y: float
    phi: float
    pixel: np.ndarray
    sure: bool = True


@dataclass(frozen=True)
class Match:
    """Blobs that make a robot of a pattern, one for each marker, and its pose x, y [m], phi [rad]."""

    pattern: Pattern
    blobs: tuple[Blob, ...]
    pose: tuple[float, float, float]

    def sighting(self, top: TopView) -> Sighting:
        """Where it is, with its place in the top view."""
        return Sighting(*self.pose, top.to_pixels([self.pose[:2]])[0])


def matches(pattern: Pattern, found: Mapping[str, Sequence[Blob]]) -> list[Match]:
    """All choices of blobs (colour -> blobs) that make a robot of this pattern."""
    fits = [
        [b for b in found[m.colour] if m.area_m2[0] <= b.area_m2 <= m.area_m2[1] and b.elongation <= pattern.elongation]
        for m in pattern.markers
    ]
    if not all(fits):
        return []
    places, where = pattern.places, [np.array([blob.place for blob in blobs]) for blobs in fits]
    i, j = max(itertools.combinations(range(len(places)), 2), key=lambda ij: np.hypot(*(places[ij[0]] - places[ij[1]])))
    apart = np.hypot(*(where[i][:, None] - where[j][None]).transpose(2, 0, 1))
    near = np.abs(apart - np.hypot(*(places[i] - places[j]))) <= pattern.tolerance_m
    others, result = [k for k in range(len(places)) if k not in (i, j)], []
    for a, b in zip(*np.nonzero(near), strict=True):
        x, y, phi = _pose(places[[i, j]], np.array([where[i][a], where[j][b]]))
        turned = places @ _turn(phi).T + [x, y]
        choices: list = [None] * len(places)
        choices[i], choices[j] = [a], [b]
        for k in others:  # each of the two may be off by half of the tolerance, which a third one sees as a turn
            choices[k] = np.nonzero(np.hypot(*(where[k] - turned[k]).T) <= 2.0 * pattern.tolerance_m)[0]
        for chosen in itertools.product(*choices):
            blobs = tuple(fits[k][n] for k, n in enumerate(chosen))
            if len({id(blob) for blob in blobs}) < len(blobs):
                continue
            pose = _laid_on(pattern, np.array([blob.place for blob in blobs]))
            if pose is not None:
                result.append(Match(pattern, blobs, pose))
    return result


def told_apart(every: Sequence[Match]) -> list[Match]:
    """The matches that stand in every set of matches without a common blob that explains the most blobs."""
    ids = [frozenset(map(id, match.blobs)) for match in every]
    conflicts = [{k for k, other in enumerate(ids) if k != i and other & one} for i, one in enumerate(ids)]
    result, left = [], set(range(len(every)))
    while left:
        heap, border = set(), {left.pop()}
        while border:
            heap |= border
            border = set().union(*(conflicts[i] for i in border)) - heap
        left -= heap
        if len(heap) <= _MOST_IN_CONFLICT:
            result += _in_every_largest(sorted(heap), conflicts, [len(one) for one in ids])
    return [every[i] for i in sorted(result)]


def _in_every_largest(heap, conflicts, sizes):
    """Members of a heap that are in all its independent sets of the largest total size."""
    best, common = 0, set()

    def search(rest, chosen, size):
        nonlocal best, common
        if size + sum(sizes[i] for i in rest) < best:
            return
        if not rest:
            best, common = size, set(chosen) if size > best else common & set(chosen)
            return
        first, *others = rest
        search([i for i in others if i not in conflicts[first]], [*chosen, first], size + sizes[first])
        if conflicts[first] & set(others):
            search(others, chosen, size)

    search(heap, [], 0)
    return common


def _laid_on(pattern, where):
    """The pose (x, y, phi) in which the pattern's markers lie on the points (n, 2), None if they do not."""
    x, y, phi = _pose(pattern.places, where)
    misses = np.hypot(*(pattern.places @ _turn(phi).T + [x, y] - where).T)
    return (float(x), float(y), float(phi)) if misses.max() <= pattern.tolerance_m / 2.0 else None


def _pose(places, where):
    """x, y, phi that lays the places (n, 2) on the points (n, 2) best, by least squares."""
    middle, centre = places.mean(axis=0), where.mean(axis=0)
    a, b = places - middle, where - centre
    phi = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    return (*(centre - _turn(phi) @ middle), phi)


def _turn(phi):
    c, s = np.cos(phi), np.sin(phi)
    return np.array([[c, -s], [s, c]])
