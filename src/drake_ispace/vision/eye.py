"""An eye on a place: top views of one camera, and the robots to look for in each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.vision.markers import Colour, Sighting, Target, find_robots
from drake_ispace.vision.top_view import TopView


@dataclass(frozen=True)
class Look:
    """A top view at the height of the markers of some robots."""

    top: TopView
    targets: tuple[Target, ...]


class Eye:
    """Finds robots in images.

    Args:
        size: (columns, rows) of the images; looks: where and what to look for; colours: by the names in the targets.
    """

    def __init__(self, size: tuple[int, int], looks: Sequence[Look], colours: Mapping[str, Colour]):
        self.size, self.looks, self.colours = tuple(size), list(looks), dict(colours)
        self._reach = [look.top.reach(self.size) for look in self.looks]

    def locate(self, image: np.ndarray) -> dict[str, Sighting | None]:
        """Name -> its pose in W with its place in the image [pixels]; None where it is not seen.

        Raises:
            InputError: an image of another size or kind.
        """
        if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.shape != (*self.size[::-1], 3):
            width, height = self.size
            raise InputError(
                f"expected an image of {width} x {height} pixels with 3 colours of 8 bit, got {_kind(image)}"
            )
        sightings: dict[str, Sighting | None] = {}
        for look, reach in zip(self.looks, self._reach, strict=True):
            found = find_robots(look.top.warp(image), look.top, self.colours, look.targets, reach)
            sightings |= {name: _in_image(one, look.top) for name, one in found.items()}
        return sightings


def _kind(image) -> str:
    """What an image is, in the words of the sentence that refuses it: width before height."""
    if not isinstance(image, np.ndarray) or image.ndim not in (2, 3):
        return "no image"
    colours = image.shape[2] if image.ndim == 3 else 1
    return f"{image.shape[1]} x {image.shape[0]} with {colours} of {8 * image.dtype.itemsize} bit"


def _in_image(sighting, top):
    return None if sighting is None else replace(sighting, pixel=top.to_image(sighting.pixel)[0])
