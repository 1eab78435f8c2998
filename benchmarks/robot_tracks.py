"""Eight robots of two teams in rendered videos: are they found, where, and is each still the one it was?

    python benchmarks/robot_tracks.py [--videos 4] [--seconds 30] [--quick] [--tiny] [--json]

In half of the videos each robot of a team has a pattern of its own beside the team's colour, in the other half the four
robots of a team look alike. Every few seconds each robot is hidden for half a second, and each is pushed by hand, now
and then while it is hidden. The pictures have a Bayer pattern and JPEG. Truth comes from the renderer.
"""

import time

import numpy as np
from _runs import options, print_json, print_table

from drake_ispace.room.room import Scenery, Space
from drake_ispace.vision.drawing.renderer import Renderer, hit
from drake_ispace.vision.drawing.scene import PAINTS, Box, Patch
from drake_ispace.vision.finding.eye import Eye, Look
from drake_ispace.vision.finding.patterns import Marker, Pattern, Target
from drake_ispace.vision.finding.tracker import Tracker
from drake_ispace.vision.image_localizer import COLOURS
from drake_ispace.vision.optics.camera import view_of
from drake_ispace.vision.optics.top_view import top_view_of

FRAME_S = 1.0 / 30.0
TEAMS, IDS = ("blue", "yellow"), (("red", "green"), ("green", "red"), ("red", "red"), ("green", "green"))
SIDE_M, HEIGHT_M, PLATE_M = 0.06, 0.15, 0.20
HIDDEN_S, PUSH_M_S = 0.5, 0.8
NEAR_M = 0.05  # of a robot's middle, or it is none


def pattern_of(team, ids):
    """The team's marker in front, two others behind it, left and right."""
    area = (0.8 * SIDE_M**2, 1.2 * SIDE_M**2)
    return Pattern((
        Marker(team, 0.055, 0.0, area), Marker(ids[0], -0.05, 0.05, area), Marker(ids[1], -0.05, -0.05, area)
    ), 0.012, 1.25)


def robots(alike):
    """Name -> pattern of eight robots."""
    return {f"{team} {i}": pattern_of(team, IDS[0 if alike else i]) for team in TEAMS for i in range(4)}


def box_of(pattern, pose):
    patches = tuple(Patch(m.x_m, m.y_m, SIDE_M, SIDE_M, PAINTS[m.colour]) for m in pattern.markers)
    return Box(*map(float, pose), PLATE_M, PLATE_M, HEIGHT_M, (38.0, 36.0, 34.0), patches=patches)


def motions(number, frames, space, rng):
    """(frames, robots, 3) poses and (frames, robots) whether a robot is hidden: robots that wander and keep apart."""
    half = np.array([space.width_m, space.depth_m]) / 2.0 - 0.2
    place = np.array([[x, y] for y in (-0.5, 0.5) for x in np.linspace(-0.8, 0.8, number // 2)])
    velocity, heading, turn = np.zeros((number, 2)), rng.uniform(-np.pi, np.pi, number), np.zeros(number)
    poses, hidden = np.empty((frames, number, 3)), np.zeros((frames, number), bool)
    for frame in range(frames):
        poses[frame] = np.column_stack([place, heading])
        force = rng.normal(0.0, 3.0, (number, 2)) - 0.5 * velocity
        force -= 20.0 * np.sign(place) * np.clip(np.abs(place) - half, 0.0, None)
        for i in range(number):
            away = place[i] - np.delete(place, i, axis=0)
            apart = np.hypot(*away.T)[:, None]
            force[i] += (30.0 * np.clip(0.35 - apart, 0.0, None) * away / apart).sum(axis=0)
        velocity = velocity + FRAME_S * force
        turn = 0.95 * turn + rng.normal(0.0, 0.3, number)
        for i in range(number):
            if rng.random() < FRAME_S / 5.0:
                hidden[frame : frame + round(HIDDEN_S / FRAME_S), i] = True
            if rng.random() < FRAME_S / 6.0:
                angle = rng.uniform(-np.pi, np.pi)
                velocity[i] = PUSH_M_S * np.array([np.cos(angle), np.sin(angle)])
        velocity *= np.minimum(1.0, 1.0 / np.maximum(np.hypot(*velocity.T), 1e-9))[:, None]
        place, heading = _apart(place + FRAME_S * velocity), heading + FRAME_S * turn
    hidden[0] = False
    return poses, hidden


def is_visible(i, boxes, view, space):
    """Whether nothing stands between the camera and any point of a robot's markers, all of them above the space."""
    grid = np.linspace(-SIDE_M / 2.0, SIDE_M / 2.0, 4)
    own = np.array([[m.x_m + x, m.y_m + y, HEIGHT_M] for m in boxes[i].patches for x in grid for y in grid])
    points = own @ boxes[i].into(np.eye(3)).T + [boxes[i].x_m, boxes[i].y_m, 0.0]
    if (np.abs(points[:, :2]) > np.array([space.width_m, space.depth_m]) / 2.0 - 0.01).any():
        return False
    rays = points - view.p_ws
    others = (box for j, box in enumerate(boxes) if j != i)
    return all((hit(other, view.p_ws, rays)[0] > 1.0 - 1e-6).all() for other in others)


def _apart(place):
    """The places with no two robots in one another: who stands too close is moved, both by the same."""
    for _ in range(20):
        for i in range(len(place)):
            for j in range(i):
                away = place[i] - place[j]
                short = max(2.0**0.5 * PLATE_M - np.hypot(*away), 0.0)
                place[i] += short / 2.0 * away / np.hypot(*away)
                place[j] -= short / 2.0 * away / np.hypot(*away)
    return place


def follow(alike, frames, seed, show=lambda *_: None):
    """Scores of one video."""
    rng, patterns = np.random.default_rng(seed), robots(alike)
    space = Space(scenery=Scenery(bayer=True, jpeg_quality=80))
    view, names = view_of(space.camera), list(patterns)
    top = top_view_of(view, space.width_m, space.depth_m, space.localizer.pixel_m, HEIGHT_M)
    eye = Eye(view.size, [Look(top, tuple(Target(name, pattern) for name, pattern in patterns.items()))], COLOURS)
    poses, hidden = motions(len(names), frames, space, rng)
    tracker = Tracker(eye, {name: poses[0, i, :2] for i, name in enumerate(names)})
    renderer = Renderer(view, space.scenery, seed=int(rng.integers(1_000_000)))
    seen = right = sure = wrong_but_sure = visible = 0
    missed, spent = [], 0.0
    for frame in range(frames):
        boxes = [box_of(patterns[name], pose) for name, pose in zip(names, poses[frame], strict=True)]
        boxes += [
            Box(x, y, 0.3, 0.34, 0.34, 0.42, (90.0, 120.0, 170.0), bottom_m=0.40)
            for x, y, _ in poses[frame][hidden[frame]]
        ]
        image = renderer.render(boxes, tick=frame).colour
        started = time.perf_counter()
        found = tracker.follow(frame * FRAME_S, image)
        spent += time.perf_counter() - started
        show(image, eye, found)
        pixels = view.project(np.column_stack([poses[frame, :, :2], np.full(len(names), HEIGHT_M)]))
        visible += sum(is_visible(i, boxes, view, space) for i in range(len(names)))
        for name, one in found.items():
            if one is None:
                continue
            apart = np.hypot(*(poses[frame, :, :2] - [one.x, one.y]).T)
            is_right = apart.argmin() == names.index(name) and apart.min() < NEAR_M
            seen, right, sure = seen + 1, right + is_right, sure + one.sure
            wrong_but_sure += one.sure and not is_right
            if apart.min() < NEAR_M:
                missed.append(np.hypot(*(one.pixel - pixels[apart.argmin()])))
    return {
        "frames": frames, "visible": visible, "seen": seen, "right": int(right), "sure": sure,
        "wrong_but_sure": int(wrong_but_sure), "pixels": missed, "seconds": spent,
    }


def picture(folder, alike, frames, seed):
    """Save the last of so many frames, with the names of the robots that were found."""
    import cv2

    from drake_ispace.vision.footage.overlay import annotate

    scores = {}
    follow(alike, frames, seed, lambda image, eye, found: scores.update(image=annotate(image, eye, found)))
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / "robot_tracks.png"), scores["image"])


def summary(videos):
    """Shares and medians over the videos of one kind."""
    total = {key: sum(video[key] for video in videos) for key in videos[0] if key != "pixels"}
    pixels = np.concatenate([video["pixels"] for video in videos])
    return {
        "frames": total["frames"],
        "found": total["seen"] / total["visible"],
        "identity_right": total["right"] / total["seen"],
        "sure": total["sure"] / total["seen"],
        "wrong_but_sure": total["wrong_but_sure"] / total["seen"],
        "pixels_median": float(np.median(pixels)),
        "pixels_95": float(np.percentile(pixels, 95)),
        "frames_a_second": total["frames"] / total["seconds"],
    }


def main():
    asked = options(
        __doc__, videos={"type": int, "default": 4, "help": "of each kind, default 4"},
        seconds={"type": float, "default": 30.0, "help": "of each video, default 30"},
    )
    videos = 1 if asked.quick else asked.videos
    frames = round((0.1 if asked.tiny else min(asked.seconds, 10.0) if asked.quick else asked.seconds) / FRAME_S)
    data = {
        kind: summary([follow(alike, frames, [asked.seed, alike, video]) for video in range(videos)])
        for kind, alike in (("own patterns", False), ("four look alike", True))
    }
    if asked.figures:
        picture(asked.figures, False, 2 if asked.tiny else 60, asked.seed)
    if asked.json:
        print_json(data)
        return
    titles = ["robots", "frames", "found", "identity", "sure", "wrong, sure", "pixels, median", "95 %", "frames/s"]
    shares = "found", "identity_right", "sure", "wrong_but_sure"
    rows = [
        [kind, row["frames"], *(f"{100.0 * row[key]:.2f} %" for key in shares),
         f"{row['pixels_median']:.2f}", f"{row['pixels_95']:.2f}", f"{row['frames_a_second']:.0f}"]
        for kind, row in data.items()
    ]
    print_table("eight robots of two teams, hidden for 0.5 s and pushed by hand", titles, rows)


if __name__ == "__main__":
    main()
