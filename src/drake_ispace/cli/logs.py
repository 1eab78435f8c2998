"""The commands for somebody's own robot: `import`, from logs to recordings, `export`, from recordings to trajectories,
`robot`, which shows the robot of a robot file, and `new`, which writes a file to begin with. Heavy libraries are
imported inside the functions."""

from importlib import resources
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.cli.options import Json
from drake_ispace.cli.terminal import print_json, print_table, progress, say
from drake_ispace.files.places import check_folder, whole_file


def register(app: App) -> None:
    """Add the commands of this module."""
    app.command(import_, name="import")
    app.command(export)
    app.command(robot)
    app.command(new)


def import_(
    *paths: Path,
    sniff: Annotated[bool, Parameter(negative="", help="propose a mapping for these logs instead")] = False,
    out: Annotated[
        Path | None, Parameter(help="folder of the recordings and of model.yaml; with --sniff the mapping file")
    ] = None,
    as_json: Json = False,
) -> None:
    """Make recordings of logs: a mapping file, then a folder for each run (left out: that of the mapping)."""
    if not paths:
        raise InputError("import: expected a mapping file and folders of logs, or --sniff and logs")
    if sniff:
        _sniff(list(paths), out)
        return
    mapping_file, *folders = paths
    if out is None:
        raise InputError("--out: expected the folder for the recordings")
    check_folder(out)
    from drake_ispace.files.yaml_guard import dump_yaml
    from drake_ispace.logs.convert import convert
    from drake_ispace.logs.mapping import load_mapping

    mapping, told = load_mapping(mapping_file), {}
    folders = folders or [mapping_file.parent]
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"{folder}: expected a folder with the logs of a run")
    names = [folder.resolve().name for folder in folders]
    if len(set(names)) < len(names):
        raise InputError("import: two folders of the same name, expected a name of its own for each run")
    for folder, name in zip(folders, names, strict=True):
        said: list[str] = []
        with progress(None, f"reading {name}"):
            recording = convert(mapping, folder, said.append)
        recording.save(out / name)
        told[name] = said
    with whole_file(out / "model.yaml") as beside:
        text = f"# The robot {mapping.robot.name} as {mapping_file.name} describes it\n"
        beside.write_text(text + dump_yaml(mapping.robot.scenario()), encoding="utf-8")
    if as_json:
        print_json({"model": str(out / "model.yaml"), "recordings": {n: str(out / n) for n in told}, "notes": told})
        return
    for name, said in told.items():
        say(out / name)
        for sentence in said:
            say(f"  {sentence}")
    say(f"next: drake-ispace explain {' '.join(str(out / name) for name in told)} --model {out / 'model.yaml'}")


def _sniff(files, out):
    from drake_ispace.logs.sniff import sniff

    text = sniff(files)
    if out is None:
        say(text.rstrip())
        return
    if out.suffix not in (".yaml", ".yml"):
        raise InputError(f"--out {out}: expected a mapping file, a name that ends in .yaml")
    check_folder(out.parent)
    with whole_file(out) as beside:
        beside.write_text(text, encoding="utf-8")
    say(f"{out}: read it, and correct what is wrong")


def export(
    run: Path, /, *, out: Annotated[Path, Parameter(help="file to write, its name ends in .tum")],
    channel: Annotated[str, Parameter(help="kinect, truth or reference")] = "kinect",
) -> None:
    """Write the poses of a recording as a TUM trajectory: t x y z qx qy qz qw."""
    if out.suffix != ".tum":
        raise InputError(f"--out {out}: expected a trajectory, a name that ends in .tum")
    check_folder(out.parent)
    from drake_ispace.logs.tum import trajectory
    from drake_ispace.robots.recordings import load

    text = trajectory(load(run), channel, str(run))
    with whole_file(out) as beside:
        beside.write_text(text, encoding="utf-8")
    say(out)


def robot(
    file: Path, /, *, out: Annotated[Path | None, Parameter(help="picture of the top view, .png or .svg")] = None,
    as_json: Json = False,
) -> None:
    """Show the robot of a robot file: its wheels, what motion each makes, what it cannot do and what looks wrong."""
    import numpy as np

    from drake_ispace.robots.robot_file import robot_of

    one = robot_of(file)
    rows = [
        {"wheel": entry.name, "x_m": w.x_m, "y_m": w.y_m, "drive_deg": float(np.degrees(w.drive_rad)),
         "diameter_m": 2.0 * w.radius_m, "motion": [float(v) for v in column]}
        for entry, w, column in zip(one.wheels, [e.wheel for e in one.wheels], one.geometry.forward.T, strict=True)
    ]
    if out is not None:
        if out.suffix not in (".png", ".svg"):
            raise InputError(f"--out {out}: expected a picture, a name that ends in .png or .svg")
        check_folder(out.parent)
        from drake_ispace.report.pictures.robot_drawing import draw_robot

        draw_robot(one, out)
    if as_json:
        print_json({"name": one.name, "wheels": rows, "cannot": one.cannot(), "doubts": one.doubts()})
        return
    titles = ["wheel", "x [m]", "y [m]", "drives [deg]", "diameter [m]", "a turn forward alone moves the robot by"]
    turn = 2.0 * np.pi
    print_table(titles, [
        [row["wheel"], f"{row['x_m']:.4f}", f"{row['y_m']:.4f}", f"{row['drive_deg']:.1f}", f"{row['diameter_m']:.4f}",
         "x {:+.3f} m, y {:+.3f} m, {:+.1f} deg".format(*(turn * v for v in row["motion"][:2]),
                                                       np.degrees(turn * row["motion"][2]))]
        for row in rows
    ])
    for sentence in one.cannot():
        say(f"cannot move {sentence}")
    for sentence in one.doubts():
        say(f"looks wrong: {sentence}")
    if out is not None:
        say(out)


def new(
    kind: Literal["robot", "effect"], name: str, /, *,
    out: Annotated[Path | None, Parameter(help="file to write; left out: of that name, in the current folder")] = None,
) -> None:
    """Write a commented file to begin with, which works as it is: a robot file, or an effect of your own."""
    if not (name.isidentifier() and name.isascii()):
        raise InputError(f"new: {shown(name)}: expected a name of letters, digits and _")
    template = "robot.yaml" if kind == "robot" else "effect.py"
    file = out or Path(f"{name}{Path(template).suffix}")
    if file.exists():
        raise InputError(f"{file}: is there already, expected a new file")
    check_folder(file.parent)
    text = (resources.files("drake_ispace.cli") / "templates" / template).read_text(encoding="utf-8")
    with whole_file(file) as beside:
        beside.write_text(text.replace("NAME", name), encoding="utf-8")
    say(file)
