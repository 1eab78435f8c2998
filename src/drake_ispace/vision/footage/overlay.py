"""Footage with what was found drawn over it: an image of the first frame, and a video."""

import uuid
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.places import whole_file
from drake_ispace.vision.finding.eye import Eye

_ARROW_PIXELS = 26
_COLOUR = (255, 255, 255)


def annotate(image: np.ndarray, eye: Eye, sightings: dict, title: str = "") -> np.ndarray:
    """A copy of the image with an arrow along the heading and the name of each robot that was found."""
    drawn = image.copy()
    tops = {target.name: look.top for look in eye.looks for target in look.targets}
    for name, one in sightings.items():
        if one is None:
            continue
        ahead = tops[name].to_image(
            tops[name].to_pixels([[one.x + 0.05 * np.cos(one.phi), one.y + 0.05 * np.sin(one.phi)]])
        )
        way = ahead[0] - one.pixel
        tip = one.pixel + _ARROW_PIXELS * way / max(np.hypot(*way), 1e-9)
        start, end = (tuple(round(16 * value) for value in point) for point in (one.pixel, tip))
        cv2.circle(drawn, start, 4 * 16, _COLOUR, 1, cv2.LINE_AA, shift=4)
        cv2.line(drawn, start, end, _COLOUR, 1, cv2.LINE_AA, shift=4)
        left = min(max(int(one.pixel[0]) - 20, 2), image.shape[1] - 8 * len(name))
        below = int(one.pixel[1]) + (30 if one.pixel[1] < image.shape[0] - 45 else -22)
        _write(drawn, name.replace("_", " "), (left, below))
    if title:
        _write(drawn, title, (8, 16))
    return drawn


def numbered(image: np.ndarray, places) -> np.ndarray:
    """A copy of the image with a number at each place (u, v)."""
    drawn = image.copy()
    for number, (u, v) in enumerate(places):
        _write(drawn, str(number), (round(u) + 6, round(v) - 6))
    return drawn


def write_image(file: Path, image: np.ndarray) -> None:
    """Write a PNG, whole or not at all.

    Raises:
        InputError: it cannot be written.
    """
    with whole_file(file) as beside:
        beside.write_bytes(cv2.imencode(".png", image)[1].tobytes())


def _write(image, text, place):
    for colour, width in (((0, 0, 0), 3), (_COLOUR, 1)):
        cv2.putText(image, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, colour, width, cv2.LINE_AA)


class Overlay:
    """Writes `located.png` (first frame) and, when there are more, `located.mp4` into a folder, whole or not at all.

    Raises (from its methods):
        InputError: the folder cannot be written.
    """

    def __init__(self, folder: Path):
        self._folder, self._first, self._video, self._time = folder, None, None, 0.0
        self._beside = folder / f".{uuid.uuid4().hex}.mp4"

    def __enter__(self) -> "Overlay":
        return self

    def add(self, image: np.ndarray, eye: Eye, sightings: dict, time_s: float) -> None:
        """The next frame."""
        drawn = annotate(image, eye, sightings, f"{time_s:.2f} s")
        if self._first is None:
            self._first = drawn
            write_image(self._folder / "located.png", drawn)
        elif self._video is None:
            rate = 1.0 / max(time_s - self._time, 1e-3)
            size = drawn.shape[1::-1]
            self._video = cv2.VideoWriter(str(self._beside), cv2.VideoWriter_fourcc(*"mp4v"), rate, size)
            if not self._video.isOpened():
                raise InputError(f"{self._folder}: this OpenCV cannot write mp4 videos, expected one image or no --out")
            self._video.write(self._first)
        if self._video is not None:
            self._video.write(drawn)
        self._time = time_s

    def __exit__(self, kind, *_) -> None:
        if self._video is not None:
            self._video.release()
            if kind is None:
                self._beside.replace(self._folder / "located.mp4")
        with suppress(OSError):
            self._beside.unlink()
