"""Real footage: a scene file that says what a camera looks at, and the images or videos it made."""

import contextlib
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.files.quantity import quantity
from drake_ispace.files.typed_tree import read
from drake_ispace.files.yaml_guard import load_yaml
from drake_ispace.room.room import Camera
from drake_ispace.vision.camera import camera_matrix, view_of
from drake_ispace.vision.eye import Eye, Look
from drake_ispace.vision.markers import Colour, Target
from drake_ispace.vision.top_view import TopView, corners_from_points, trapezoid

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")


@dataclass
class MarkerSize:
    """The sizes of a marker and of a pair of markers."""

    spacing_m: float = quantity(0.2, "m", above=0.0)
    tolerance_m: float = quantity(0.01, "m", above=0.0)
    area_m2: list[float] = quantity([0.007, 0.0092], "m^2", above=0.0, length=2)
    elongation: float = quantity(1.12, minimum=1.0)


@dataclass
class ColourRange:
    """See `markers.Colour`."""

    hue: list[float] = quantity([0.0, 180.0], minimum=0.0, maximum=180.0, length=2)
    saturation: float = quantity(100.0, minimum=0.0, maximum=255.0)
    value: float = quantity(60.0, minimum=0.0, maximum=255.0)
    most_saturation: float = quantity(255.0, minimum=0.0, maximum=255.0)
    most_value: float = quantity(255.0, minimum=0.0, maximum=255.0)


@dataclass
class RobotMarkers:
    """A robot's two colours, and their height above the floor."""

    front: str = quantity("")
    rear: str = quantity("")
    height_m: float = quantity(0.0, "m", minimum=0.0, maximum=2.0)


@dataclass
class Scene:
    """The scene that a camera looks at. Frame W as in space.camera.

    Without `points` the camera's own place is used, with them its size, focal lengths and distortion only, and all
    heights count as 0.
    """

    width_m: float = quantity(2.5, "m", above=0.0, maximum=100.0)
    depth_m: float = quantity(2.0, "m", above=0.0, maximum=100.0)
    pixel_m: list[float] = quantity([0.00487, 0.00551], "m/pixel", above=1e-4, length=2)
    camera: Camera = field(default_factory=Camera)
    # on the floor: u, v [pixels], x, y [m] of at least four
    points: list[list[float]] = quantity([], "pixels, pixels, m, m")
    markers: MarkerSize = field(default_factory=MarkerSize)
    #: by name; in the file mappings
    colours: dict[str, ColourRange] = field(default_factory=dict)
    robots: dict[str, RobotMarkers] = field(default_factory=dict)


def scene_names() -> list[str]:
    """The packaged scenes."""
    folder = resources.files("drake_ispace.vision") / "scenes"
    return sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_scene(name_or_file: str) -> Scene:
    """The scene of that name, or in that YAML file.

    Raises:
        InputError: unknown name or key, a value of the wrong kind, a robot without colours.
    """
    if name_or_file in scene_names():
        data = load_yaml(
            (resources.files("drake_ispace.vision") / "scenes" / f"{name_or_file}.yaml").read_text(), name_or_file
        )
    elif name_or_file.endswith((".yaml", ".yml")) or "/" in name_or_file:
        data = load_yaml(Path(name_or_file), name_or_file)
    else:
        raise InputError(f"there is no scene {shown(name_or_file)}, {expected_one_of(name_or_file, scene_names())}")
    tables = {"colours": ColourRange, "robots": RobotMarkers}
    scene = read(Scene(), {key: value for key, value in data.items() if key not in tables}, name_or_file)
    for key, kind in tables.items():
        entries = data.get(key)
        if not isinstance(entries, dict) or not entries:
            raise InputError(f"{name_or_file}: {key}: expected a mapping with at least one name, got {shown(entries)}")
        setattr(scene, key, {str(n): read(kind(), value, f"{name_or_file}: {key}.{n}") for n, value in entries.items()})
    for name, robot in scene.robots.items():
        for colour in (robot.front, robot.rear):
            if colour not in scene.colours:
                raise InputError(
                    f"{name_or_file}: robots.{name}: no colour {shown(colour)}, "
                    f"{expected_one_of(colour, scene.colours)}"
                )
    for i, point in enumerate(scene.points):
        if len(point) != 4:
            raise InputError(f"{name_or_file}: points[{i}]: expected u, v, x, y, got {len(point)} numbers")
    return scene


def scene_eye(scene: Scene, where: str = "scene") -> Eye:
    """The eye that finds the scene's robots in its images.

    Raises:
        InputError: points or a camera that show no floor.
    """
    sizes, looks = scene.markers, []
    for height in sorted({robot.height_m for robot in scene.robots.values()}):
        targets = tuple(
            Target(
                name,
                robot.front,
                robot.rear,
                sizes.spacing_m,
                sizes.tolerance_m,
                tuple(sizes.area_m2),
                sizes.elongation,
            )
            for name, robot in scene.robots.items()
            if robot.height_m == height
        )
        looks.append(Look(scene_top(scene, where, height), targets))
    colours = {
        name: Colour(tuple(c.hue), c.saturation, c.value, c.most_saturation, c.most_value)
        for name, c in scene.colours.items()
    }
    return Eye(tuple(scene.camera.size_pixels), looks, colours)


def scene_top(scene: Scene, where: str = "scene", height_m: float = 0.0) -> TopView:
    """The top view of the scene, `height_m` above its floor.

    Raises:
        InputError: points or a camera that show no floor.
    """
    matrix, distortion = camera_matrix(scene.camera), np.array(scene.camera.distortion)
    if scene.width_m / scene.pixel_m[0] * scene.depth_m / scene.pixel_m[1] > 2e7:
        raise InputError(f"{where}: pixel_m: expected a top view of at most 20 million pixels")
    if scene.points:
        try:
            corners = corners_from_points(scene.points, scene.width_m, scene.depth_m, matrix, distortion)
        except (ValueError, cv2.error):
            raise InputError(
                f"{where}: points: expected at least four points u, v, x, y on the floor, no three on a line"
            ) from None
    else:
        corners = trapezoid(view_of(scene.camera), scene.width_m, scene.depth_m, height_m)
    if not np.isfinite(corners).all():
        raise InputError(f"{where}: the camera does not see the whole {scene.width_m:g} x {scene.depth_m:g} m floor")
    return TopView(corners, scene.width_m, scene.depth_m, scene.pixel_m, matrix, distortion)


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
