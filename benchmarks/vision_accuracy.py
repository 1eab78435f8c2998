"""How well the room sees: poses from images over the whole space, distractors and occlusion, both robots in the loop on
images against the geometric mode fitted to them, footprints and free space from depth, real footage, and speed.

    python benchmarks/vision_accuracy.py [--quick] [--tiny] [--json] [--figures docs/pictures]
"""

import itertools
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from _runs import options, print_json, print_table

import drake_ispace as di
from drake_ispace.blocks.messages import FIX
from drake_ispace.metrics import measure
from drake_ispace.room.room import Space
from drake_ispace.vision.depth_map import UNKNOWN, free_space_overlap, map_of, true_cells
from drake_ispace.vision.drawing.renderer import Renderer, with_noise
from drake_ispace.vision.drawing.scene import PAINTS, Box, Patch, obstacles, robot_box
from drake_ispace.vision.finding.eye import find_robots
from drake_ispace.vision.image_localizer import room_eye
from drake_ispace.vision.optics.calibration import calibrate
from drake_ispace.vision.optics.camera import view_of
from drake_ispace.vision.optics.top_view import CORNERS, trapezoid

ROBOTS = ("omni", "pendulum")
AXLE_M = 0.08  # of the pendulum
CAMERA = {"bayer": True, "jpeg_quality": 80}
EDGE_M = 0.16  # from a robot's middle to the far corners of its markers
WRONG_M, WRONG_RAD = 0.02, np.radians(6.0)  # a pose further off is a wrong detection
FOOTAGE = (
    Path(os.environ.get("DRAKE_ISPACE_DATA", Path(__file__).parents[2] / "shared" / "data"))
    / "overhead/vsss_static.mp4"
)
#: Read off the footage by eye, +-3 pixels.
FOOTAGE_ROBOTS = {
    "navy_light_blue": (250, 211), "green_lime": (427, 178), "red_lime": (447, 358), "red_navy": (50, 280),
    "navy_green": (75, 380), "light_blue_lime": (70, 412),
}


def random_poses(rng, space):
    """A pose for each robot, anywhere in the space, not on each other."""
    half = np.array([space.width_m, space.depth_m]) / 2.0 - EDGE_M
    while True:
        poses = np.column_stack([rng.uniform(-half, half, (2, 2)), rng.uniform(-np.pi, np.pi, 2)])
        if np.hypot(*(poses[0] - poses[1])[:2]) > 0.45:
            return poses


def errors_of(found, pose):
    """(dx, dy [m], dphi [rad]) of a sighting."""
    return found.x - pose[0], found.y - pose[1], np.angle(np.exp(1j * (found.phi - pose[2])))


def accuracy(images, seed, tilt_rad=0.0, **scenery):
    """Both robots in every image, moving: errors (n, 3), true poses (n, 3) of the sightings, how many were not seen.

    tilt_rad: standard deviation of the pendulum's tilt, whose top's middle is then the true place. scenery: changes.
    """
    rng, errors, poses, unseen = np.random.default_rng(seed), [], [], 0
    space = replace(Space(), scenery=replace(Space().scenery, **scenery))
    renderer, eye = Renderer(view_of(space.camera), space.scenery, seed=seed), room_eye(space, ROBOTS)
    for image in range(images):
        true = random_poses(rng, space)
        moved = rng.uniform(-1.0, 1.0, (2, 3)) * [0.3, 0.3, 1.0] * space.camera.exposure_s
        tilt = tilt_rad * rng.standard_normal() if tilt_rad else 0.0
        boxes = [robot_box(ROBOTS[0], space, true[0]), robot_box(ROBOTS[1], space, true[1], tilt, AXLE_M)]
        picture = renderer.render(boxes, moved, image)
        sightings, phi = eye.locate(picture.colour), true[1, 2]
        true[1, :2] += (space.markers.pendulum_height_m - AXLE_M) * np.sin(tilt) * np.array([np.cos(phi), np.sin(phi)])
        for name, pose in zip(ROBOTS, true, strict=True):
            if sightings[name] is None:
                unseen += 1
            else:
                errors.append(errors_of(sightings[name], pose))
                poses.append(pose)
    return np.array(errors), np.array(poses), unseen


def with_clicked_corners(cameras, images, seed):
    """Errors (n, 3) where the camera was calibrated by four clicks that are off by one pixel (standard deviation)."""
    rng, space, errors = np.random.default_rng(seed), Space(), []
    view = view_of(space.camera)
    renderer, corners = Renderer(view, space.scenery, seed=seed), CORNERS * [space.width_m, space.depth_m]
    for camera in range(cameras):
        clicks = trapezoid(view, space.width_m, space.depth_m) + rng.normal(0.0, 1.0, (4, 2))
        believed = replace(space, camera=calibrate(np.hstack([clicks, corners]), space.camera).camera)
        eye = room_eye(believed, ROBOTS)
        for image in range(images):
            true = random_poses(rng, space)
            boxes = [robot_box(n, space, p) for n, p in zip(ROBOTS, true, strict=True)]
            found = eye.locate(renderer.render(boxes, tick=1000 * camera + image).colour)
            errors += [errors_of(found[n], p) for n, p in zip(ROBOTS, true, strict=True) if found[n] is not None]
    return np.array(errors)


def hard_pictures(images, seed):
    """Distractors of the markers' and of near colours, and bars that hide parts of robots: (wrong, seen, not seen)."""
    rng, space = np.random.default_rng(seed), Space()
    renderer, eye = Renderer(view_of(space.camera), space.scenery, seed=seed), room_eye(space, ROBOTS)
    wrong = seen = 0
    for image in range(images):
        true = random_poses(rng, space)
        there = rng.random(2) < 0.8  # or the robot is not in the room at all
        boxes = [robot_box(n, space, p) for n, p, here in zip(ROBOTS, true, there, strict=True) if here]
        for _ in range(rng.integers(1, 7)):  # things on the floor, some as large as a marker
            side = rng.choice([space.markers.side_m, rng.uniform(0.04, 0.3)])
            colour = PAINTS[rng.choice(list(PAINTS))]
            boxes.append(
                Box(
                    *rng.uniform([-1.2, -0.9, 0.0], [1.2, 0.9, 3.0]),
                    side,
                    side,
                    rng.uniform(0.01, 0.3),
                    (60.0, 60.0, 60.0),
                    patches=(Patch(0.0, 0.0, side, side, colour),),
                )
            )
        for x, y, _ in true:  # a bar above each robot, often over a marker
            boxes.append(Box(x + rng.normal(0.0, 0.15), y + rng.normal(0.0, 0.15), rng.uniform(0.0, np.pi), 0.6,
                             rng.uniform(0.02, 0.1), 0.5, bottom_m=0.45))
        found = eye.locate(renderer.render(boxes, tick=image).colour)
        for name, pose, here in zip(ROBOTS, true, there, strict=True):
            if found[name] is not None:
                dx, dy, dphi = errors_of(found[name], pose)
                seen += 1
                wrong += not here or np.hypot(dx, dy) > WRONG_M or abs(dphi) > WRONG_RAD
    return int(wrong), int(seen), 2 * images - int(seen)


def fit_geometric(errors):
    """Overrides with which the geometric mode has the image mode's noise, and the bias [m, m, rad] of the image mode.

    The age of its frames, 3 ticks in the mean, is no latency: a message comes on its tick, and says its frame's tick.

    Marker noise n [pixels of the grid] gives a pose noise of n pixel / sqrt(2) and a heading noise of
    sqrt(2) n pixel / spacing; n is their least-squares fit in units of each.
    """
    localizer = Space().localizer
    pixel, std = np.array(localizer.pixel_m), errors.std(axis=0)
    of_unit = np.array([*pixel / np.sqrt(2.0), np.sqrt(2.0) * np.sqrt((pixel**2).mean()) / localizer.marker_spacing_m])
    noise = float(np.sqrt(np.mean((std / of_unit) ** 2)))
    settings = {
        "space.localizer.whole_pixels": False, "space.localizer.noise_std_pixels": round(noise, 3),
    }
    return settings, errors.mean(axis=0)


def in_the_loop(settings, seconds, seed, robots):
    """rms position error of the square [m]: robot -> (image mode, fitted geometric mode, geometric mode as it is)."""
    rows = {}
    for name in robots:
        modes = {
            "image": ["space.localizer.mode=image"],
            "fitted": [f"{k}={str(v).lower()}" for k, v in settings.items()],
            "geometric": [],
        }
        rows[name] = {}
        for mode, overrides in modes.items():
            sets = [f"seconds={seconds}", f"seed={seed}", f"{name}.trajectory.kind=square", *overrides]
            run = di.simulate(di.load_scenario(f"{name}_multirate", sets))
            fixes = run.signals[f"{name}_fix"]
            _, first = np.unique(fixes[:, FIX.tick], return_index=True)
            captures, result = fixes[first], measure(run, name)
            rows[name][mode] = {
                "rms_position_error_m": result.rms_position_error_m, "rms_cross_track_m": result.rms_cross_track_m,
                "seen": float(captures[captures[:, FIX.tick] >= 0.0, FIX.seen].mean()), "wall_s": run.wall_s,
            }
    return rows


def depth_maps(rooms, seed):
    """Boxes anywhere in rooms with two robots: worst corner of each footprint [m], errors of height [m], overlaps of
    free space, in all and of what is seen."""
    rng, corners, heights, overlaps, seen_overlaps = np.random.default_rng(seed), [], [], [], []
    for room in range(rooms):
        space = Space()
        while True:
            middles = rng.uniform([-0.95, -0.7], [0.95, 0.7], (4, 2))
            gaps = np.hypot(*(middles[:, None] - middles[None]).transpose(2, 0, 1)) + 9.0 * np.eye(4)
            if gaps.min() > 0.75:
                break
        space.scenery.obstacles = [
            [*middle, *rng.uniform([0.0, 0.15, 0.15, 0.1], [np.pi, 0.3, 0.3, 0.35])] for middle in middles[:2]
        ]
        static = obstacles(space)
        robots = [robot_box(n, space, (*m, rng.uniform(0.0, 6.0))) for n, m in zip(ROBOTS, middles[2:], strict=True)]
        view = view_of(space.camera)
        depth = Renderer(view, space.scenery, static, seed=seed).render(robots, tick=room).depth
        found = map_of(view, depth, space.width_m, space.depth_m, [robot.footprint(0.04) for robot in robots])
        for box in static:
            nearest = min(found.obstacles, key=lambda o: np.hypot(o.x_m - box.x_m, o.y_m - box.y_m), default=None)
            if nearest is None:
                corners.append(np.inf)
                continue
            outline = Box(
                nearest.x_m, nearest.y_m, nearest.yaw_rad, nearest.length_m, nearest.width_m, nearest.height_m
            )
            gap = np.hypot(*(outline.footprint()[:, None] - box.footprint()[None]).transpose(2, 0, 1))
            corners.append(max(gap.min(axis=0).max(), gap.min(axis=1).max()))
            heights.append(nearest.height_m - box.top_m)
        corners += [np.inf] * (len(found.obstacles) != len(static))
        truth = true_cells([*static, *robots], space.width_m, space.depth_m)
        known = found.cells != UNKNOWN
        overlaps.append(free_space_overlap(found.cells, truth))
        seen_overlaps.append(free_space_overlap(found.cells[known], truth[known]))
    return np.array(corners), np.array(heights), np.array(overlaps), np.array(seen_overlaps)


def speed(seed, repetitions):
    """Pictures per second of each stage, both robots in the room: the median over the repetitions."""
    space = Space()
    view, rng = view_of(space.camera), np.random.default_rng(seed)
    renderer, eye = Renderer(view, space.scenery, seed=seed), room_eye(space, ROBOTS)
    boxes = [robot_box(n, space, p) for n, p in zip(ROBOTS, random_poses(rng, space), strict=True)]
    drawn = renderer.draw(boxes)
    picture = with_noise(drawn, space.scenery, seed, 0)
    tops = [look.top.warp(picture.colour) for look in eye.looks]
    stages = {
        "render": lambda: renderer.draw(boxes),
        "noise": lambda: with_noise(drawn, space.scenery, seed, 0),
        "top views (2)": lambda: [look.top.warp(picture.colour) for look in eye.looks],
        "threshold, moments, pose": lambda: [
            find_robots(top, look, eye.colours) for top, look in zip(tops, eye.looks, strict=True)
        ],
        "whole localiser": lambda: eye.locate(picture.colour),
        "depth map": lambda: map_of(view, picture.depth, 2.5, 2.0),
    }
    rates = {}
    for name, stage in stages.items():
        times = []
        for _ in range(repetitions):
            started = time.perf_counter()
            stage()
            times.append(time.perf_counter() - started)
        rates[name] = float(1.0 / np.median(times))
    return rates


def footage(most):
    """Real footage, `most` frames of it: how many, robots found, worst distance from the listed places [pixels],
    distances of the crosses; None where there is none."""
    if not FOOTAGE.is_file():
        return None
    from drake_ispace.vision.footage.frames import frames
    from drake_ispace.vision.footage.scene_file import load_scene, scene_eye, scene_top

    scene = load_scene("vsss")
    eye, worst, seen, count = scene_eye(scene), 0.0, 0, 0
    for _, image in itertools.islice(frames(FOOTAGE), most):
        found = {name: one for name, one in eye.locate(image).items() if one is not None}
        worst = max([worst, *(float(np.hypot(*(one.pixel - FOOTAGE_ROBOTS[name]))) for name, one in found.items())])
        seen, count = seen + len(found), count + 1
    points = np.array(scene.points)

    def distances(top):
        crosses = top.to_metres(top.from_image(points[:, :2]))
        return (np.hypot(*(crosses[:3] - crosses[3:]).T).tolist(),
                np.hypot(*(crosses[[0, 1, 3, 4]] - crosses[[1, 2, 4, 5]]).T).tolist())

    along, across = distances(scene_top(scene))
    # Independent of the crosses: the corners of both goal areas, 1.2 x 0.7 m apart, as found in the picture.
    areas = [
        [97.0, 112.2, -0.6, 0.35],
        [98.3, 368.0, -0.6, -0.35],
        [539.4, 111.1, 0.6, 0.35],
        [542.2, 366.0, 0.6, -0.35],
    ]
    held_out = distances(scene_top(replace(scene, points=areas)))
    return {
        "frames": count, "found_of_six": seen / count, "worst_pixels": worst, "crosses_along_m": along,
        "crosses_across_m": across, "held_out_along_m": held_out[0], "held_out_across_m": held_out[1],
    }


def main():
    asked = options(__doc__)
    images, hard, rooms, cameras, repetitions, most, seconds = 300, 300, 30, 20, 12, None, 30.0
    if asked.tiny:
        images, hard, rooms, cameras, repetitions, most, seconds = 2, 1, 1, 1, 1, 1, 1.1
    elif asked.quick:
        images, hard, rooms, cameras, repetitions, most, seconds = 40, 40, 5, 3, 12, None, 8.0
    errors, poses, unseen = accuracy(images, asked.seed)
    distance, angle = 1e3 * np.hypot(errors[:, 0], errors[:, 1]), np.degrees(np.abs(errors[:, 2]))
    camera_errors, _, camera_unseen = accuracy(images, asked.seed, tilt_rad=0.03, **CAMERA)
    camera_mm, camera_deg = 1e3 * np.hypot(*camera_errors[:, :2].T), np.degrees(np.abs(camera_errors[:, 2]))
    clicked = with_clicked_corners(cameras, 5, asked.seed)
    clicked_mm, clicked_deg = 1e3 * np.hypot(clicked[:, 0], clicked[:, 1]), np.degrees(np.abs(clicked[:, 2]))
    wrong, seen, hidden = hard_pictures(hard, asked.seed)
    settings, bias = fit_geometric(errors)
    loop = in_the_loop(settings, seconds, asked.seed, ROBOTS[:1] if asked.tiny else ROBOTS)
    corners, heights, overlaps, seen_overlaps = depth_maps(rooms, asked.seed)
    rates, real = speed(asked.seed, repetitions), footage(most)
    data = {
        "poses": 2 * images,
        "not_seen": unseen,
        "position_mm": dict(
            zip(("median", "p95", "max"), np.percentile(distance, [50, 95, 100]).tolist(), strict=True)
        ),
        "heading_deg": dict(zip(("median", "p95", "max"), np.percentile(angle, [50, 95, 100]).tolist(), strict=True)),
        "camera": {
            "not_seen": camera_unseen, "position_mm": np.percentile(camera_mm, [50, 95, 100]).tolist(),
            "heading_deg": np.percentile(camera_deg, [50, 95, 100]).tolist(),
        },
        "clicked": {
            "sightings": len(clicked), "position_mm": np.percentile(clicked_mm, [50, 95]).tolist(),
            "heading_deg": np.percentile(clicked_deg, [50, 95]).tolist(),
        },
        "hard": {"poses": 2 * hard, "wrong": wrong, "seen": seen, "not_seen": hidden},
        "fitted": settings,
        "bias": bias.tolist(),
        "loop": loop,
        "depth": {
            "boxes": len(corners),
            "worst_corner_mm": 1e3 * float(corners.max()),
            "median_corner_mm": 1e3 * float(np.median(corners)),
            "worst_height_mm": 1e3 * float(np.abs(heights).max()),
            "least_overlap": float(overlaps.min()),
            "least_overlap_of_what_is_seen": float(seen_overlaps.min()),
        },
        "pictures_per_second": rates,
        "footage": real,
    }
    if asked.figures:
        _error_map(errors, poses, asked.figures / "vision_error_map.png")
    if asked.json:
        print_json(data)
        return
    print_table(
        "1. poses from images, over the whole space",
        ["", "median", "95 %", "worst"],
        [
            [
                f"position error, mm, {len(errors)} sightings, {unseen} not seen",
                *(f"{v:.2f}" for v in data["position_mm"].values()),
            ],
            ["heading error, degrees", *(f"{v:.2f}" for v in data["heading_deg"].values())],
        ],
    )
    print(
        f"Bayer pattern, JPEG of quality 80, tilts of 1.7 degrees: {camera_unseen} not seen; "
        + "{:.2f}, 95 % {:.2f}, worst {:.2f} mm; ".format(*data["camera"]["position_mm"])
        + "{:.2f}, {:.2f}, {:.2f} degrees".format(*data["camera"]["heading_deg"])
    )
    print(
        "camera from clicks off by a pixel: median {:.2f}, 95 % {:.2f} mm; ".format(*data["clicked"]["position_mm"])
        + "{:.2f}, {:.2f} degrees".format(*data["clicked"]["heading_deg"])
    )
    print(f"distractors and occlusion: {wrong} wrong, {seen} seen, {hidden} not seen of {2 * hard}\n")
    print(
        f"2. fitted geometric mode: {settings}, bias {1e3 * bias[0]:.2f} mm, {1e3 * bias[1]:.2f} mm, "
        f"{np.degrees(bias[2]):.3f} deg"
    )
    print_table(
        f"the square, {seconds:g} s",
        ["robot", "image, rms in mm", "fitted", "ratio", "geometric", "seen", "s"],
        [
            [
                name,
                *(f"{1e3 * row[mode]['rms_position_error_m']:.2f}" for mode in ("image", "fitted")),
                f"{row['image']['rms_position_error_m'] / row['fitted']['rms_position_error_m']:.3f}",
                f"{1e3 * row['geometric']['rms_position_error_m']:.2f}",
                f"{100.0 * row['image']['seen']:.1f} %",
                f"{row['image']['wall_s']:.0f}",
            ]
            for name, row in loop.items()
        ],
    )
    print_table("speed", ["stage", "pictures a second"], [[name, f"{rate:.0f}"] for name, rate in rates.items()])
    if real:
        print(
            f"3. footage: {real['found_of_six']:.2f} of 6 robots in {real['frames']} frames, at most "
            f"{real['worst_pixels']:.2f} pixels off"
        )
        for name, key in (("crosses", "crosses"), ("crosses, goal areas as calibration", "held_out")):
            print(f"   {name}: " + " ".join(f"{v:.3f}" for v in real[f"{key}_along_m"]) + " m, "
                  + " ".join(f"{v:.3f}" for v in real[f"{key}_across_m"]) + " m")
    depth = data["depth"]
    print(
        f"4. depth: {depth['boxes']} boxes, corner of a footprint at most {depth['worst_corner_mm']:.1f} mm off (median"
        " "
        f"{depth['median_corner_mm']:.1f}), height {depth['worst_height_mm']:.1f} mm; free space overlap at least "
        f"{depth['least_overlap']:.3f}, {depth['least_overlap_of_what_is_seen']:.3f} of what is seen"
    )


def _error_map(errors, poses, out):
    from drake_ispace.report.pictures.plots import plt, save

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for axis, values, title in (
        (axes[0], 1e3 * np.hypot(errors[:, 0], errors[:, 1]), "position error [mm]"),
        (axes[1], np.degrees(np.abs(errors[:, 2])), "heading error [deg]"),
    ):
        dots = axis.scatter(
            poses[:, 0], poses[:, 1], c=values, s=22, cmap="viridis", vmin=0.0, vmax=np.percentile(values, 99)
        )
        figure.colorbar(dots, ax=axis, label=title)
        axis.add_patch(plt.Rectangle((-1.25, -1.0), 2.5, 2.0, fill=False, ls=":", ec="0.5"))
        axis.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title=title)
    save(figure, out)


if __name__ == "__main__":
    main()
