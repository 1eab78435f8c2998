"""Scene files: the place that a camera looks at, the colours of its markers and the robots to look for."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from importlib import resources
from pathlib import Path

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.files.quantity import quantity
from drake_ispace.files.typed_tree import difference, read
from drake_ispace.files.yaml_guard import load_yaml
from drake_ispace.room.room import Camera
from drake_ispace.vision.finding.eye import Eye, Look
from drake_ispace.vision.finding.markers import Colour
from drake_ispace.vision.finding.patterns import Marker, Pattern, Target, pair
from drake_ispace.vision.finding.tracker import Tracker
from drake_ispace.vision.optics.calibration import read_points
from drake_ispace.vision.optics.camera import camera_matrix, view_of
from drake_ispace.vision.optics.top_view import TopView, corners_from_points, trapezoid

_PACKAGED = resources.files("drake_ispace.vision.footage") / "scenes"
_MOST_MARKERS = 6  # of a robot


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
class MarkerPlace:
    """A marker on a robot's top, in the robot's frame: x forward, y to the left."""

    colour: str = quantity("")
    x_m: float = quantity(0.0, "m", minimum=-2.0, maximum=2.0)
    y_m: float = quantity(0.0, "m", minimum=-2.0, maximum=2.0)
    # least and largest; null: that of `markers`
    area_m2: list[float] | None = quantity(None, "m^2", above=0.0, length=2)


@dataclass
class RobotMarkers:
    """A robot's markers: a front and a rear one, or a list of two to six, and their height above the floor."""

    front: str = quantity("")
    rear: str = quantity("")
    #: in the file a list of mappings, see `MarkerPlace`
    markers: list[MarkerPlace] = field(default_factory=list)
    height_m: float = quantity(0.0, "m", minimum=0.0, maximum=2.0)
    # x, y in W in the first frame, by which robots that look alike get their names; null: from left to right
    start_m: list[float] | None = quantity(None, "m", length=2)


@dataclass
class Tracking:
    """How robots move between two frames of a video."""

    # rms, each for a tenth of a second; pushes by hand count too
    acceleration_m_s2: float = quantity(3.0, "m/s^2", above=0.0, maximum=1e3)
    most_speed_m_s: float = quantity(3.0, "m/s", above=0.0, maximum=100.0)


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
    tracking: Tracking = field(default_factory=Tracking)
    #: by name; in the file mappings
    colours: dict[str, ColourRange] = field(default_factory=dict)
    robots: dict[str, RobotMarkers] = field(default_factory=dict)


def scene_names() -> list[str]:
    """The packaged scenes."""
    return sorted(entry.name.removesuffix(".yaml") for entry in _PACKAGED.iterdir() if entry.name.endswith(".yaml"))


def load_scene(name_or_file: str) -> Scene:
    """The scene of that name, or in that YAML file.

    Raises:
        InputError: unknown name or key, a value of the wrong kind, a robot without colours, or robots whose markers do
            not tell their heading or, one hidden, which of them it is.
    """
    if name_or_file in scene_names():
        data = load_yaml((_PACKAGED / f"{name_or_file}.yaml").read_text(), name_or_file)
    elif name_or_file.endswith((".yaml", ".yml")) or "/" in name_or_file:
        data = load_yaml(Path(name_or_file), name_or_file)
    else:
        raise InputError(f"there is no scene {shown(name_or_file)}, {expected_one_of(name_or_file, scene_names())}")
    scene = read(Scene(), {key: value for key, value in data.items() if key not in _TABLES}, name_or_file)
    for key, one in _TABLES.items():
        entries = data.get(key)
        if not isinstance(entries, dict) or not entries:
            raise InputError(f"{name_or_file}: {key}: expected a mapping with at least one name, got {shown(entries)}")
        setattr(scene, key, {str(name): one(value, f"{name_or_file}: {key}.{name}") for name, value in entries.items()})
    for i, point in enumerate(scene.points):
        if len(point) != 4:
            raise InputError(f"{name_or_file}: points[{i}]: expected u, v, x, y, got {len(point)} numbers")
    _check_robots(scene, name_or_file)
    return scene


def _robot(data, where):
    """The RobotMarkers of plain data."""
    if not isinstance(data, dict) or "markers" not in data:
        return read(RobotMarkers(), data, where)
    robot = read(RobotMarkers(), {key: value for key, value in data.items() if key != "markers"}, where)
    places = data["markers"]
    if not isinstance(places, list) or not 2 <= len(places) <= _MOST_MARKERS:
        raise InputError(f"{where}: markers: expected a list of 2 to {_MOST_MARKERS} markers, got {shown(places)}")
    robot.markers = [read(MarkerPlace(), place, f"{where}: markers[{i}]") for i, place in enumerate(places)]
    return robot


_TABLES = {"colours": lambda data, where: read(ColourRange(), data, where), "robots": _robot}


def _check_robots(scene, where):
    """Refuse robots without colours, and those whose heading or name their markers do not tell."""
    for name, robot in scene.robots.items():
        if bool(robot.markers) == bool(robot.front or robot.rear):
            raise InputError(f"{where}: robots.{name}: expected either front and rear or markers")
        for colour in [m.colour for m in robot.markers] or [robot.front, robot.rear]:
            if colour not in scene.colours:
                raise InputError(
                    f"{where}: robots.{name}: no colour {shown(colour)}, {expected_one_of(colour, scene.colours)}"
                )
    patterns = {name: _pattern(scene, robot) for name, robot in scene.robots.items()}
    for name, one in patterns.items():
        if one.part_of(one):
            raise InputError(
                f"{where}: robots.{name}: its markers look the same when it has turned, expected a pattern that tells "
                "its heading"
            )
        for other, pattern in patterns.items():
            if pattern != one and len(pattern.markers) >= len(one.markers) and one.part_of(pattern):
                raise InputError(
                    f"{where}: robots.{name}: its markers are among those of {other}, expected patterns that differ "
                    "when a marker is hidden"
                )


def _pattern(scene, robot):
    sizes = scene.markers
    if not robot.markers:
        return pair(
            robot.front, robot.rear, sizes.spacing_m, sizes.tolerance_m, tuple(sizes.area_m2), sizes.elongation
        )
    markers = (Marker(m.colour, m.x_m, m.y_m, tuple(m.area_m2 or sizes.area_m2)) for m in robot.markers)
    return Pattern(tuple(markers), sizes.tolerance_m, sizes.elongation)


def scene_on_points(texts: Sequence[str], width_m: float, depth_m: float, image: np.ndarray) -> Scene:
    """A scene without robots whose floor is known by points "u,v,x,y" in an image (rows, columns, 3).

    Its top view is about as fine as the image.

    Raises:
        InputError: points of another form, or that show no floor.
    """
    rows, columns = image.shape[:2]
    points = [list(map(float, point)) for point in read_points(texts, width_m, depth_m)]
    scene = Scene(width_m, depth_m, [1.0, 1.0], Camera(size_pixels=[columns, rows]), points)
    far_left, far_right, near_right, near_left = _corners(scene, "--points", 0.0)
    across = np.hypot(*(far_right - far_left)) + np.hypot(*(near_right - near_left))
    along = np.hypot(*(far_left - near_left)) + np.hypot(*(far_right - near_right))
    scene.pixel_m = [float(f"{2.0 * width_m / across:.3g}"), float(f"{2.0 * depth_m / along:.3g}")]
    return scene


def scene_data(scene: Scene) -> dict:
    """What differs from a scene by default as plain mappings, ready for YAML."""
    data = difference(asdict(scene), asdict(Scene()))
    for table, default in (("colours", ColourRange()), ("robots", RobotMarkers())):
        data[table] = {name: difference(one, asdict(default)) for name, one in asdict(scene)[table].items()}
    for robot in data["robots"].values():
        if "markers" in robot:
            robot["markers"] = [{k: v for k, v in marker.items() if v is not None} for marker in robot["markers"]]
    return data


def scene_eye(scene: Scene, where: str = "scene") -> Eye:
    """The eye that finds the scene's robots in its images.

    Raises:
        InputError: points or a camera that show no floor.
    """
    looks = []
    for height in sorted({robot.height_m for robot in scene.robots.values()}):
        targets = tuple(
            Target(name, _pattern(scene, robot)) for name, robot in scene.robots.items() if robot.height_m == height
        )
        looks.append(Look(scene_top(scene, where, height), targets))
    colours = {
        name: Colour(tuple(c.hue), c.saturation, c.value, c.most_saturation, c.most_value)
        for name, c in scene.colours.items()
    }
    return Eye(tuple(scene.camera.size_pixels), looks, colours)


def scene_tracker(scene: Scene, eye: Eye) -> Tracker:
    """The tracker that follows the scene's robots with its eye."""
    starts = {name: robot.start_m for name, robot in scene.robots.items() if robot.start_m is not None}
    return Tracker(eye, starts, scene.tracking.acceleration_m_s2, scene.tracking.most_speed_m_s)


def scene_top(scene: Scene, where: str = "scene", height_m: float = 0.0) -> TopView:
    """The top view of the scene, `height_m` above its floor.

    Raises:
        InputError: points or a camera that show no floor.
    """
    if scene.width_m / scene.pixel_m[0] * scene.depth_m / scene.pixel_m[1] > 2e7:
        raise InputError(f"{where}: pixel_m: expected a top view of at most 20 million pixels")
    corners, camera = _corners(scene, where, height_m), scene.camera
    return TopView(
        corners, scene.width_m, scene.depth_m, scene.pixel_m, camera_matrix(camera), np.array(camera.distortion)
    )


def _corners(scene, where, height_m):
    """(4, 2) pixels of the corners of the floor, or of the plane `height_m` above it."""
    if scene.points:
        matrix, distortion = camera_matrix(scene.camera), np.array(scene.camera.distortion)
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
    return corners
