"""The commands on pictures: `locate` robots in footage, `scene learn` to teach it what to look for, `calibrate` the
camera, `vision` for a page of what the room sees. Imported by app.py; heavy libraries are imported inside."""

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from drake_ispace.blocks.errors import InputError
from drake_ispace.cli.options import Json, whole
from drake_ispace.cli.terminal import print_json, print_table, say
from drake_ispace.files.places import check_folder, whole_file

_TRIED = 300  # frames in which a learned scene is tried


def register(app: App) -> None:
    """Add the commands of this module."""
    app.command(locate)
    app.command(calibrate)
    scene = App(name="scene", help="Scene files: what a camera looks at, for `locate`.")
    scene.command(learn)
    app.command(scene)
    app.command(vision)


def locate(
    footage: Path, /, *, scene: Annotated[str, Parameter(help="vsss, room or a scene's YAML file")] = "room",
    out: Annotated[Path | None, Parameter(help="folder for the annotated image and, of a video, the overlay")] = None,
    as_json: Json = False,
) -> None:
    """Find robots in an image or a video by the colours of their markers.

    Robots that look alike are told apart by the way they came.
    """
    if out is not None:
        check_folder(out)
    from drake_ispace.vision.footage.frames import frames
    from drake_ispace.vision.footage.scene_file import load_scene, scene_eye, scene_tracker

    settings = load_scene(scene)
    eye = scene_eye(settings, scene)
    tracker, found = scene_tracker(settings, eye), []
    with _pictures(out) as show:
        for time_s, image in frames(footage):
            try:
                sightings = tracker.follow(time_s, image)
            except InputError as error:
                raise InputError(f"{footage}: {error}") from None
            found.append(
                {"t": time_s, "robots": [_row(name, one) for name, one in sightings.items() if one is not None]}
            )
            show(image, eye, sightings, time_s)
    if as_json:
        print_json({"frames": found})
        return
    rows, unsure = [], []
    for name in (target.name for look in eye.looks for target in look.targets):
        seen = [robot for frame in found for robot in frame["robots"] if robot["name"] == name]
        last = (
            [f"{seen[-1][key]:.{digits}f}" for key, digits in zip("u v x y phi".split(), (1, 1, 4, 4, 3), strict=True)]
            if seen
            else ["not seen"] + [""] * 4
        )
        rows.append([name, f"{len(seen)} of {len(found)}", *last])
        unsure += [name] if seen and not seen[-1]["sure"] else []
    print_table(["robot", "frames", "u", "v", "x [m]", "y [m]", "phi [rad]"], rows)
    if unsure:
        say(f"not sure, for they look alike and may have changed places while hidden: {', '.join(unsure)}")
    if out is not None:
        say(f"pictures: {out}")


def calibrate(
    image: Path,
    /,
    *,
    points: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="u,v,x,y of points on the floor [pixels, m]; or u,v of the space's four corners: far left, far right, "
            "near right, near left",
        ),
    ] = None,
    board: Annotated[
        str | None,
        Parameter(
            help="columns,rows,square,x,y,yaw of a chessboard on the floor to look for instead: inner corners, side "
            "[m], place of the first [m], direction of the first row [rad]"
        ),
    ] = None,
    width: Annotated[float, Parameter(help="of the space [m]")] = 2.5,
    depth: Annotated[float, Parameter(help="of the space [m]")] = 2.0,
    fit_focal: Annotated[
        bool, Parameter(negative="", help="find the focal length too, instead of that of the Kinect")
    ] = False,
    fit_lens: Annotated[bool, Parameter(negative="", help="find how much the lens bends straight lines too")] = False,
    out: Annotated[Path | None, Parameter(help="scenario file to write; left out: the text is printed")] = None,
    as_json: Json = False,
) -> None:
    """Find where a camera stands from points on the floor of one of its images: a scenario's camera section."""
    if not (0.0 < width < 1e3 and 0.0 < depth < 1e3):
        raise InputError(f"--width, --depth: expected metres above 0, got {width:g} and {depth:g}")
    if (points is None) == (board is None):
        raise InputError("calibrate: expected either --points or --board")
    if out is not None:
        check_folder(out.parent)
    from drake_ispace.files.yaml_guard import dump_yaml
    from drake_ispace.room.room import Camera
    from drake_ispace.vision.footage.frames import frames
    from drake_ispace.vision.optics.calibration import board_points, read_points
    from drake_ispace.vision.optics.calibration import calibrate as solve

    _, first = next(frames(image))
    rows, columns = first.shape[:2]
    given = board_points(first, board) if board is not None else read_points(points, width, depth)
    if outside := [p for p in given if not (-0.5 <= p[0] <= columns - 0.5 and -0.5 <= p[1] <= rows - 0.5)]:
        raise InputError(
            f"--points: ({outside[0][0]:g}, {outside[0][1]:g}) lies outside of {image}, expected 0 to {columns - 1}, "
            f"0 to {rows - 1}"
        )
    result = solve(given, replace(Camera(), size_pixels=[columns, rows]), fit_focal, fit_lens)
    data, residual = {"space": result.to_data()}, float((result.residual_pixels**2).mean() ** 0.5)
    if out is not None:
        with whole_file(out) as beside:
            beside.write_text(
                f"# Camera of {image.name}; {residual:.2f} pixels rms\n{dump_yaml(data)}", encoding="utf-8"
            )
    if as_json:
        print_json(data | {"rms_pixels": residual, "residual_pixels": result.residual_pixels.tolist()})
        return
    say(out if out is not None else dump_yaml(data).rstrip())
    say(f"# rms {residual:.2f} pixels over {len(given)} points")


def learn(
    footage: Path, /, *,
    marker: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="robot:colour:u,v, a pixel of a marker in the first picture; of each robot the front one first, then "
            "the rear one, then any others. Left out: what stands out by its colour is listed",
        ),
    ] = None,
    scene: Annotated[str, Parameter(help="scene whose floor and camera are kept, instead of --points")] = "room",
    points: Annotated[
        list[str] | None, Parameter(negative="", help="the floor: u,v,x,y of four points or more, as for calibrate")
    ] = None,
    width: Annotated[float, Parameter(help="of the floor [m], with --points")] = 2.5,
    depth: Annotated[float, Parameter(help="of the floor [m], with --points")] = 2.0,
    height: Annotated[
        list[str] | None,
        Parameter(negative="", help="robot:metres, of its markers above the floor, instead of that in the scene"),
    ] = None,
    out: Annotated[Path | None, Parameter(help="scene file to write; a picture of the same name shows it")] = None,
    as_json: Json = False,
) -> None:
    """Learn a scene file for `locate` from the markers that one points at in an image or the first frame of a video."""
    if not (0.0 < width < 1e3 and 0.0 < depth < 1e3):
        raise InputError(f"--width, --depth: expected metres above 0, got {width:g} and {depth:g}")
    if out is not None:
        if out.suffix not in (".yaml", ".yml"):
            raise InputError(f"--out {out}: expected a scene file, a name that ends in .yaml")
        check_folder(out.parent)
    from drake_ispace.files.yaml_guard import dump_yaml
    from drake_ispace.vision.footage.frames import frames
    from drake_ispace.vision.footage.learn import coloured_blobs, read_heights, read_pointed
    from drake_ispace.vision.footage.learn import learn as learned_from
    from drake_ispace.vision.footage.overlay import annotate, numbered, write_image
    from drake_ispace.vision.footage.scene_file import load_scene, scene_data, scene_eye, scene_on_points, scene_tracker

    _, first = next(frames(footage))
    if not marker:
        blobs = coloured_blobs(first)
        if out is not None:
            write_image(out.with_suffix(".png"), numbered(first, [place for place, _ in blobs]))
        if as_json:
            print_json({"blobs": [{"u": u, "v": v, "colour": word} for (u, v), word in blobs]})
            return
        print_table(["", "u", "v", "colour"], [[i, f"{u:.0f}", f"{v:.0f}", w] for i, ((u, v), w) in enumerate(blobs)])
        say("expected with --marker robot:colour:u,v for the markers among them")
        return
    floor = load_scene(scene) if points is None else scene_on_points(points, width, depth, first)
    settings = learned_from(first, floor, read_pointed(marker), read_heights(height or []))
    eye, found = scene_eye(settings), []
    tracker = scene_tracker(settings, eye)
    for time_s, image in itertools.islice(frames(footage), _TRIED):
        found.append(tracker.follow(time_s, image))
    data = scene_data(settings)
    if out is not None:
        with whole_file(out) as beside:
            beside.write_text(f"# Learned from {footage.name}\n{dump_yaml(data)}", encoding="utf-8")
        write_image(out.with_suffix(".png"), annotate(first, eye, found[0]))
    seen = {name: sum(frame[name] is not None for frame in found) for name in settings.robots}
    if as_json:
        print_json({"scene": data, "frames": len(found), "seen": seen})
        return
    say(out if out is not None else dump_yaml(data).rstrip())
    print_table(["robot", "found in frames"], [[name, f"{count} of {len(found)}"] for name, count in seen.items()])


def vision(
    *, out: Annotated[Path, Parameter(help="folder of the page")] = Path("vision"),
    seconds: Annotated[float, Parameter(help="of the run with both robots [s]")] = 14.0,
    seed: Annotated[int, Parameter(help="of carpet and noise", converter=whole)] = 0, as_json: Json = False,
) -> None:
    """Write a page with what the room sees: perspective, top view, thresholds, depth, map, and both robots tracking."""
    if not 1.0 <= seconds <= 600.0 or seed < 0:
        raise InputError(f"--seconds, --seed: expected 1 to 600 s and a seed of at least 0, got {seconds:g} and {seed}")
    from drake_ispace.cli.terminal import progress
    from drake_ispace.report.vision_page import write_vision_page

    with progress(None, "vision") as advance:
        page, data = write_vision_page(out, seconds, seed, advance)
    if as_json:
        print_json(data | {"page": str(page)})
        return
    say(f"open {page}")


def _row(name, sighting):
    u, v = map(float, sighting.pixel)
    return {"name": name, "u": u, "v": v, "x": sighting.x, "y": sighting.y, "phi": sighting.phi, "sure": sighting.sure}


def _pictures(out):
    """A function (image, eye, sightings, time) that writes the annotated first image and the overlay video."""
    from contextlib import contextmanager

    @contextmanager
    def nothing():
        yield lambda *_: None

    @contextmanager
    def writing():
        from drake_ispace.vision.footage.overlay import Overlay

        with Overlay(out) as overlay:
            yield overlay.add

    return nothing() if out is None else writing()
