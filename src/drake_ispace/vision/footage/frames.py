"""Images and videos from files, frame by frame."""

import contextlib
import os
import zlib
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")


def frames(path: Path) -> Iterator[tuple[float, np.ndarray]]:
    """(time [s], image) of an image file, or of every frame of a video.

    Raises:
        InputError: no such file, or no image or video in it.
    """
    if not path.is_file():
        raise InputError(f"{path}: expected an image or a video file, there is none")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: is empty, expected an image or a video")
    if path.suffix.lower() in IMAGES:
        yield 0.0, _image(path)
        return
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    with _quiet():
        video, count = cv2.VideoCapture(str(path)), 0
    try:
        rate = video.get(cv2.CAP_PROP_FPS)
        rate = rate if 0.0 < rate < 1e4 else 30.0
        while True:
            with _quiet():
                read_one, image = video.read()
            if not read_one:
                break
            yield count / rate, image
            count += 1
    finally:
        video.release()
    if count == 0:
        raise InputError(f"{path}: no video can be read from it, expected one that OpenCV knows, such as mp4")


def _image(path) -> np.ndarray:
    data, image = np.fromfile(path, np.uint8), None
    if path.suffix.lower() != ".png" or _is_whole_png(data.tobytes()):
        with _quiet(), contextlib.suppress(cv2.error):  # damaged, or too large
            image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{path}: no image can be read from it, expected a whole file of {', '.join(IMAGES)}")
    return image


def _is_whole_png(data: bytes) -> bool:
    """Whether every checksum of a PNG is right; its decoder stops at the last pixel and compares some of them only."""
    at, kind = 8, b""
    while kind != b"IEND" and at + 12 <= len(data):
        end = at + 12 + int.from_bytes(data[at : at + 4])
        kind = data[at + 4 : at + 8]
        if zlib.crc32(data[at + 4 : end - 4]) != int.from_bytes(data[end - 4 : end]):
            return False
        at = end
    return kind == b"IEND" or data[:8] != b"\x89PNG\r\n\x1a\n"  # of another kind in spite of its name


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Decoders write what they think of a bad file to the process's error output; the InputError's sentence is enough.
    """
    try:
        kept = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
