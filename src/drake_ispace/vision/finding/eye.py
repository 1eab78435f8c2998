"""An eye on a place: top views of one camera, and the robots to look for in each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.vision.finding.markers import Colour, find_blobs
from drake_ispace.vision.finding.patterns import Pattern, Sighting, Target, matches, told_apart
from drake_ispace.vision.optics.top_view import TopView


@dataclass(frozen=True)
class Look:
    """A top view at the height of the markers of some robots."""

    top: TopView
    targets: tuple[Target, ...]

    def alike(self) -> dict[Pattern, list[str]]:
        """Names of the robots of each pattern."""
        names: dict[Pattern, list[str]] = {}
        for target in self.targets:
            names.setdefault(target.pattern, []).append(target.name)
        return names


class Eye:
    """Finds robots in images.

    Args:
        size: (columns, rows) of the images; looks: where and what to look for; colours: by the names in the targets.
    """

    def __init__(self, size: tuple[int, int], looks: Sequence[Look], colours: Mapping[str, Colour]):
        self.size, self.looks, self.colours = tuple(size), list(looks), dict(colours)
        self._reach = [look.top.reach(self.size) for look in self.looks]

    def see(self, image: np.ndarray) -> list[tuple[list[str], list[Sighting]]]:
        """For each pattern the names of its robots, and where one of them is seen.

        Raises:
            InputError: an image of another size or kind.
        """
        if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.shape != (*self.size[::-1], 3):
            width, height = self.size
            raise InputError(
                f"expected an image of {width} x {height} pixels with 3 colours of 8 bit, got {_kind(image)}"
            )
        seen = []
        for look, reach in zip(self.looks, self._reach, strict=True):
            for names, found in find_robots(look.top.warp(image), look, self.colours, reach):
                seen.append((names, [replace(one, pixel=look.top.to_image(one.pixel)[0]) for one in found]))
        return seen

    def locate(self, image: np.ndarray) -> dict[str, Sighting | None]:
        """Name -> its pose in W with its place in the image [pixels].

        A robot that is not there, hidden, cut by the border or not told apart is None, never a guess.

        Raises:
            InputError: an image of another size or kind.
        """
        sightings: dict[str, Sighting | None] = {}
        for names, found in self.see(image):
            sightings |= dict.fromkeys(names, found[0] if len(names) == len(found) == 1 else None)
        return {target.name: sightings[target.name] for look in self.looks for target in look.targets}


def find_robots(
    image: np.ndarray, look: Look, colours: Mapping[str, Colour], reach: np.ndarray | None = None
) -> list[tuple[list[str], list[Sighting]]]:
    """For each pattern of a look the names of its robots, and where the top view (rows, columns, 3) shows one."""
    alike = look.alike()
    markers = [marker for pattern in alike for marker in pattern.markers]
    limits = min(m.area_m2[0] for m in markers), max(m.area_m2[1] for m in markers)
    wanted = {name: colours[name] for name in {marker.colour for marker in markers}}
    found = find_blobs(image, look.top, wanted, limits, reach)
    clear = told_apart([match for pattern in alike for match in matches(pattern, found)])
    return [
        (names, [match.sighting(look.top) for match in clear if match.pattern is pattern])
        for pattern, names in alike.items()
    ]


def _kind(image) -> str:
    """What an image is, in the words of the sentence that refuses it: width before height."""
    if not isinstance(image, np.ndarray) or image.ndim not in (2, 3):
        return "no image"
    colours = image.shape[2] if image.ndim == 3 else 1
    return f"{image.shape[1]} x {image.shape[0]} with {colours} of {8 * image.dtype.itemsize} bit"
