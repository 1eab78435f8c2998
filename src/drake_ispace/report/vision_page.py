"""A page of pictures: perspective and top view, thresholds, depth, map (Figs. 5.4 to 5.7), both robots tracking in both
views (Figs. 6.13 and 6.15)."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from matplotlib.colors import ListedColormap

from drake_ispace.blocks.messages import FIX, WAY_POINT
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS
from drake_ispace.files.places import check_folder
from drake_ispace.report.pages import render, write_text
from drake_ispace.report.pictures.plots import plt, save
from drake_ispace.robots.library import robots
from drake_ispace.room.room import Space
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import Run, simulate
from drake_ispace.vision.depth_map import FREE, ROBOT, SpaceMap, map_of, points
from drake_ispace.vision.drawing.renderer import Picture
from drake_ispace.vision.drawing.scene import robot_box
from drake_ispace.vision.finding.eye import Eye
from drake_ispace.vision.finding.patterns import Sighting
from drake_ispace.vision.footage.overlay import annotate
from drake_ispace.vision.image_localizer import room_eye, room_renderer
from drake_ispace.vision.optics.camera import View, view_of
from drake_ispace.vision.optics.top_view import TopView, top_view_of, trapezoid
from drake_ispace.wiring.catalog import CATALOG

_OBSTACLES = [
    [0.75, -0.45, 0.5, 0.35, 0.25, 0.25],
    [-0.85, 0.35, 0.2, 0.25, 0.25, 0.35],
    [0.35, 0.65, -0.3, 0.4, 0.15, 0.15],
]
_POSES = dict(zip(CATALOG["shared_space"].robots, ((-0.35, -0.45, 0.6), (0.15, 0.1, 2.2)), strict=True))
#: Free, unknown, obstacle, robot: black, grey, yellow, blue.
_MAP = ListedColormap(["#101010", "#606060", "#f1c40f", "#2980b9"])
_SECTIONS = (
    (
        "views",
        "Perspective and top view (Figs. 5.4, 5.5)",
        "Left: the camera's picture with the trapezoid of the 2.5 x 2.0 m space. Right: the same as a top view of "
        "513 x 363 pixels, with the robots that were found. What stands up leans away from the camera's foot.",
    ),
    (
        "thresholds",
        "Thresholds of the markers' colours (Fig. 5.5)",
        "For each robot the top view at the height of its own markers: there they stand where they are. Below, pixels "
        "of its two colours. The pose is the middle and the direction of both centroids.",
    ),
    (
        "depth",
        "Depth (Fig. 5.6)",
        "Left: depth along the view. Right: yellow is everything that stands more than 5 cm above the floor.",
    ),
    (
        "configuration",
        "Configuration image (Fig. 5.7)",
        "Depth projected to the floor, fused with the markers: blue areas are robots, yellow ones obstacles with a box "
        "found for each (dashed: the truth), grey is hidden from the camera, black is free.",
    ),
    (
        "tracking",
        "Both robots tracking on images (Figs. 6.13, 6.15)",
        "The omni robot circles inside the pendulum's square. Above, the camera's pictures; below, the top view with "
        "the fixes so far (dots) and the way points' paths (dashed).",
    ),
)


@dataclass(frozen=True)
class _Room:
    """One picture of the room and what is seen in it."""

    space: Space
    view: View
    eye: Eye
    picture: Picture
    sightings: dict[str, Sighting | None]
    top: TopView
    map: SpaceMap


def write_vision_page(
    out: Path, seconds: float = 14.0, seed: int = 0, progress: Callable[[str], None] = lambda _: None
) -> tuple[Path, dict]:
    """Draw all pictures and write `out`/index.html with them.

    Args:
        out: folder. seconds: duration of the run with both robots. seed: of carpet and noise. progress: called with the
            name of each step.

    Returns:
        The path of the page, and poses and obstacles as numbers.

    Raises:
        InputError: a folder that cannot be written.
    """
    check_folder(out)
    progress("one picture of the room")
    room = _look(seed)
    _views(room, out / "views.png")
    _thresholds(room, out / "thresholds.png")
    _depth(room, out / "depth.png")
    _configuration(room, out / "configuration.png")
    progress("both robots on images")
    overrides = [f"seconds={seconds:.3f}", f"seed={seed}", "space.localizer.mode=image"]
    run = simulate(load_scenario("shared_space", overrides))
    progress("frames of the run")
    _strip(run, out / "tracking.png")
    sections = [{"title": title, "text": text, "picture": f"{key}.png"} for key, title, text in _SECTIONS]
    data = {
        "seed": seed,
        "poses": {name: None if one is None else [one.x, one.y, one.phi] for name, one in room.sightings.items()},
        "true_poses": {name: list(pose) for name, pose in _POSES.items()},
        "obstacles": [[o.x_m, o.y_m, o.yaw_rad, o.length_m, o.width_m, o.height_m] for o in room.map.obstacles],
        "free_share": float(np.mean(room.map.cells == FREE)),
        "wall_s": run.wall_s,
    }
    write_text(out / "vision.json", json.dumps(data, indent=2, allow_nan=False))
    columns, rows = room.view.size
    write_text(out / "index.html", render(
        "vision.html.j2", sections=sections, columns=columns, rows=rows, height=room.space.camera.height_m, seed=seed,
    ))
    return out / "index.html", data


def _look(seed):
    space = Space()
    space.scenery.obstacles = _OBSTACLES
    boxes = [robot_box(name, space, _POSES[name]) for name in _POSES]
    view, eye = view_of(space.camera), room_eye(space, _POSES)
    picture = room_renderer(space, seed).render(boxes)
    sightings = eye.locate(picture.colour)
    areas = [robot_box(name, space, (one.x, one.y, one.phi)).footprint(0.04) for name, one in sightings.items() if one]
    top = top_view_of(view, space.width_m, space.depth_m, space.localizer.pixel_m)
    map_of_room = map_of(view, picture.depth, space.width_m, space.depth_m, areas)
    return _Room(space, view, eye, picture, sightings, top, map_of_room)


def _extent(space):
    return (-space.width_m / 2.0, space.width_m / 2.0, -space.depth_m / 2.0, space.depth_m / 2.0)


def _floor(axis, space, title):
    axis.set(xlabel="x [m]", ylabel="y [m]", title=title, aspect="equal")
    axis.set_xlim(_extent(space)[:2])
    axis.set_ylim(_extent(space)[2:])


def _arrow(axis, one):
    axis.annotate("", (one.x + 0.2 * np.cos(one.phi), one.y + 0.2 * np.sin(one.phi)), (one.x, one.y),
                  arrowprops={"arrowstyle": "->", "color": "white", "lw": 1.8})


def _views(room, out):
    figure, axes = plt.subplots(1, 2, figsize=(13, 4.9), layout="constrained")
    axes[0].imshow(annotate(room.picture.colour, room.eye, room.sightings)[..., ::-1])
    corners = trapezoid(room.view, room.space.width_m, room.space.depth_m)
    axes[0].plot(*np.vstack([corners, corners[:1]]).T, color="#e67e22", lw=1.5)
    axes[0].set(title="perspective", xlabel="u [pixels]", ylabel="v [pixels]")
    axes[1].imshow(room.top.warp(room.picture.colour)[..., ::-1], extent=_extent(room.space))
    for one in filter(None, room.sightings.values()):
        _arrow(axes[1], one)
    _floor(axes[1], room.space, "top view of the floor; arrows: poses found")
    save(figure, out)


def _thresholds(room, out):
    figure, axes = plt.subplots(2, len(room.eye.looks), figsize=(13, 9.2), layout="constrained")
    for (above, below), look in zip(axes.T, room.eye.looks, strict=True):
        image = look.top.warp(room.picture.colour)
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        shown = np.zeros_like(image)
        for target in look.targets:
            for colour in (marker.colour for marker in target.pattern.markers):
                mask = room.eye.colours[colour].mask(hsv) > 0
                shown[mask] = np.median(image[mask], axis=0) if mask.any() else 0
        names = ", ".join(target.name for target in look.targets)
        above.imshow(image[..., ::-1], extent=_extent(room.space))
        below.imshow(shown[..., ::-1], extent=_extent(room.space))
        for target in look.targets:
            if one := room.sightings[target.name]:
                _arrow(below, one)
        _floor(above, room.space, f"{names}: top view at the height of its markers")
        _floor(below, room.space, f"{names}: pixels of its two colours, and the pose found")
    save(figure, out)


def _depth(room, out):
    figure, axes = plt.subplots(1, 2, figsize=(13, 4.7), layout="constrained")
    dots = axes[0].imshow(room.picture.depth, cmap="viridis_r")
    figure.colorbar(dots, ax=axes[0], label="depth along the view [m]")
    standing = points(room.view, room.picture.depth)[..., 2] > 0.05
    axes[1].imshow(standing, cmap=ListedColormap(["#101010", "#f1c40f"]), interpolation="nearest")
    for axis, title in zip(axes, ("depth image", "objects"), strict=True):
        axis.set(title=title, xlabel="u [pixels]", ylabel="v [pixels]")
    save(figure, out)


def _configuration(room, out):
    figure, axis = plt.subplots(figsize=(9, 7.2), layout="constrained")
    axis.imshow(room.map.cells, cmap=_MAP, vmin=FREE, vmax=ROBOT, extent=_extent(room.space), interpolation="nearest")
    for box in room.map.obstacles:
        corners = _corners(box.x_m, box.y_m, box.yaw_rad, box.length_m, box.width_m)
        axis.plot(*corners.T, color="#c0392b", lw=1.5)
        axis.text(box.x_m, box.y_m, f"{100 * box.length_m:.0f} x {100 * box.width_m:.0f} x {100 * box.height_m:.0f} cm",
                  ha="center", va="center", fontsize=8)
    for x, y, yaw, length, width, _ in _OBSTACLES:
        axis.plot(*_corners(x, y, yaw, length, width).T, "--", color="white", lw=1.0)
    for name, one in room.sightings.items():
        if one:
            _arrow(axis, one)
            axis.text(one.x, one.y - 0.13, name, color="white", ha="center", va="top", fontsize=9)
    _floor(axis, room.space, "configuration of the space")
    save(figure, out)


def _corners(x, y, yaw, length, width):
    c, s = np.cos(yaw), np.sin(yaw)
    square = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]) * [length / 2.0, width / 2.0]
    return square @ np.array([[c, s], [-s, c]]) + [x, y]


def _strip(run: Run, out: Path):
    """Plot both views of a run at five instants."""
    frames = 5
    space = run.scenario.space
    renderer, eye = room_renderer(space, run.scenario.seed), room_eye(space, _POSES)
    top = top_view_of(view_of(space.camera), space.width_m, space.depth_m, space.localizer.pixel_m)
    rows = len(run.time_s)
    figure, axes = plt.subplots(2, frames, figsize=(4.0 * frames, 6.4), layout="constrained")
    for (above, below), share in zip(axes.T, (np.arange(frames) + 0.5) / frames, strict=True):
        tick = int(share * rows) // VISION_TICKS * VISION_TICKS
        boxes = [robot_box(name, space, run.signals[f"{name}_pose"][tick]) for name in _POSES]
        picture = renderer.render(boxes, tick=tick)
        above.imshow(annotate(picture.colour, eye, eye.locate(picture.colour))[..., ::-1])
        above.set_title(f"{tick * TICK_S:.1f} s")
        above.set_axis_off()
        below.imshow(top.warp(picture.colour)[..., ::-1], extent=_extent(space))
        for name in _POSES:
            way, fixes = run.signals[f"{name}_way_point"], run.signals[f"{name}_fix"][: tick + 1]
            moving = way[:, WAY_POINT.tick] >= 0.0
            below.plot(*way[moving, WAY_POINT.x : WAY_POINT.y + 1].T, "--", color="white", lw=0.7)
            seen = fixes[fixes[:, FIX.seen] > 0.0]
            below.plot(*seen[::VISION_TICKS, FIX.x : FIX.y + 1].T, ".", color=robots()[name].path_colour, ms=3)
        _floor(below, space, "")
    save(figure, out)
