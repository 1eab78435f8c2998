"""The command line. Heavy libraries are imported by the commands that use them: `--help` answers at once."""

import json
import os
import sys
from collections.abc import Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from cyclopts import App, CycloptsError, Parameter, UnusedCliTokensError

from drake_ispace.errors import InputError, shown
from drake_ispace.places import check_folder

app = App(
    name="drake-ispace",
    help="Two robots in an intelligent space, as Drake Diagrams: simulate, compare and draw them.",
    suppress_keyboard_interrupt=False,
)

Json = Annotated[bool, Parameter(name="--json", negative="", help="one JSON document on standard output, nothing else")]
Sets = Annotated[
    list[str] | None,
    Parameter(name="--set", negative="", help="key=value over the scenario, as omni.plant.mass_kg=8"),
]


def _whole(kind, tokens):
    """cyclopts alone would cut 1.5 to 1."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"expected a whole number, got {shown(tokens[0].value)}") from None


Seconds = Annotated[float | None, Parameter(help="simulated time [s]")]
Seed = Annotated[int | None, Parameter(help="of every random draw", converter=_whole)]
Depth = Annotated[int | None, Parameter(help="levels of nested Diagrams to open", converter=_whole)]


def main(arguments: Iterable[str] | None = None) -> None:
    """Entry point: 0 when done, 2 and one sentence on bad input, 130 on Ctrl-C."""
    try:
        try:
            app(arguments, exit_on_error=False, print_error=False)
        finally:
            sys.stdout.flush()
    except UnusedCliTokensError as error:
        _refuse(f"unexpected {shown(' '.join(error.unused_tokens))}, expected only options after what it is about")
    except (InputError, CycloptsError) as error:
        _refuse(str(error))
    except KeyboardInterrupt:
        print("drake-ispace: stopped, nothing half-written is left behind", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        _drop_output()
        sys.exit(1)
    except OSError as error:
        _drop_output()
        _refuse(f"{error.filename or 'standard output'}: cannot be written ({error.strerror or error})")


def _refuse(sentence):
    print(" ".join(f"drake-ispace: {sentence}".split()), file=sys.stderr)
    sys.exit(2)


def _drop_output():
    """What is still in the buffer has nowhere to go, and Python would complain about that at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@app.command(name="list")
def list_(*, as_json: Json = False) -> None:
    """List the Diagrams and the packaged scenarios."""
    from drake_ispace.scenario import scenario_names
    from drake_ispace.wiring.catalog import CATALOG

    if as_json:
        _print_json({"diagrams": list(CATALOG), "scenarios": scenario_names(), "effects": []})
        return
    print("Diagrams")
    for name, builder in CATALOG.items():
        print(f"  {name:30} {builder.__doc__.strip().splitlines()[0]}")
    print("Scenarios")
    for name in scenario_names():
        print(f"  {name}")


@app.command
def simulate(
    name: str, /, *, seconds: Seconds = None, set_: Sets = None, seed: Seed = None,
    out: Annotated[Path | None, Parameter(help="folder of the recording, truth included")] = None,
    as_json: Json = False,
) -> None:
    """Simulate a scenario, given by name or YAML file, and optionally record it."""
    scenario = _scenario(name, seconds, set_, seed)
    diagram = _diagram(name, scenario)
    from drake_ispace.alignment import to_recording
    from drake_ispace.simulation import simulate_diagram

    folders = _recording_folders(diagram, out) if out is not None else {}
    with _progress(scenario.seconds, scenario.diagram) as advance:
        run = simulate_diagram(diagram, scenario, advance)
    for robot, folder in folders.items():
        to_recording(run, robot).save(folder)
    recordings = {robot: str(folder) for robot, folder in folders.items()}
    final = {robot: dict(zip("x y phi".split(), map(float, run.signals[f"{robot}_pose"][-1]), strict=True))
             for robot in run.robots}
    simulated = float(run.time_s[-1])
    first = run.robots[0]
    result = {
        "diagram": scenario.diagram, "seconds": scenario.seconds, "wall_s": run.wall_s,
        "realtime_factor": simulated / run.wall_s, "diverged": run.diverged_s is not None,
        "diverged_at_s": run.diverged_s, "final": final[first], "recording": str(out) if out is not None else None,
    }
    if len(run.robots) > 1:
        result |= {"finals": final, "recordings": recordings}
    if as_json:
        _print_json(result)
        return
    print(f"{scenario.diagram}: {simulated:g} s in {run.wall_s:.2f} s, {result['realtime_factor']:.0f} times real time")
    if run.diverged_s is not None:
        print(f"the robot fell or was lost at {run.diverged_s:.3f} s")
    for robot, pose in final.items():
        print(f"{robot} ends at x = {pose['x']:.4f} m, y = {pose['y']:.4f} m, phi = {pose['phi']:.4f} rad")
    for folder in recordings.values():
        print(f"recording: {folder}")


@app.command
def draw(
    name: str, /, *, set_: Sets = None,
    out: Annotated[Path | None, Parameter(help="x.svg, x.png or x.dot; left out: the dot text is printed")] = None,
    depth: Depth = None, as_json: Json = False,
) -> None:
    """Draw the wiring of a Diagram with Graphviz."""
    if depth is not None and not 0 <= depth <= 1000:
        raise InputError(f"--depth: expected 0 (closed) to 1000 levels, got {depth}")
    diagram = _diagram(name, _scenario(name, None, set_, None))
    from drake_ispace.drawing import dot_text
    from drake_ispace.drawing import draw as draw_diagram

    if out is not None:
        check_folder(out.parent)
        draw_diagram(diagram, out, depth)
    if as_json:
        _print_json({"diagram": diagram.get_name(), "out": str(out) if out else None, "dot": dot_text(diagram, depth)})
    else:
        print(out if out is not None else dot_text(diagram, depth))


@app.command(name="schedule")
def schedule_(name: str, /, *, set_: Sets = None, as_json: Json = False) -> None:
    """Show every periodic update of a Diagram: which block, which phase, when."""
    diagram = _diagram(name, _scenario(name, None, set_, None))
    from drake_ispace.schedule import schedule

    rows = schedule(diagram)
    if as_json:
        _print_json({"updates": rows})
        return
    _table(
        ["block", "phase", "period", "ticks", "offset"],
        [[r["block"], r["phase"], f"{1e3 * r['period_s']:.4g} ms", r["period_ticks"], f"{1e3 * r['offset_s']:.4g} ms"]
         for r in rows],
    )


@app.command
def compare(
    *names: str, seconds: Seconds = None, set_: Sets = None, seed: Seed = None,
    out: Annotated[Path | None, Parameter(help="folder for comparison.png and comparison.json")] = None,
    as_json: Json = False,
) -> None:
    """Run several Diagrams on the first one's reference with the same seed."""
    if not names:
        raise InputError("compare: expected Diagrams or scenarios, such as omni_multirate omni_vision_feedback")
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"compare: {shown(twice[0])} is named twice, expected different Diagrams or scenarios")
    scenarios = {name: _scenario(name, seconds, set_, seed) for name in names}
    if out is not None:
        check_folder(out)
    from drake_ispace.compare import compare as run_all

    total = sum(scenario.seconds for scenario in scenarios.values())
    with _progress(total, "compare") as advance:
        order, span = list(scenarios), next(iter(scenarios.values())).seconds
        results = run_all(scenarios, lambda name, t: advance(order.index(name) * span + t))
    data = {"runs": {name: metrics.to_data() for name, (_, _, metrics) in results.items()}}
    if out is not None:
        from drake_ispace.report.pages import write_text
        from drake_ispace.report.plots import plot_comparison

        plot_comparison({name: (run, robot) for name, (run, robot, _) in results.items()}, out / "comparison.png")
        write_text(out / "comparison.json", json.dumps(data, indent=2))
    if as_json:
        _print_json(data)
        return
    _print_metrics(data["runs"])
    if out is not None:
        print(f"plot: {out / 'comparison.png'}")


@app.command
def demo(
    *, seconds: Seconds = None, seed: Seed = None,
    out: Annotated[Path, Parameter(help="folder of the pages")] = Path("demo"), as_json: Json = False,
) -> None:
    """Drive both robots through the space and write a folder with pictures and an index page."""
    from drake_ispace.report.demo import write_demo

    with _progress(None, "demo") as advance:
        page, data = write_demo(out, seconds, seed, advance)
    if as_json:
        _print_json(data | {"page": str(page)})
        return
    _print_metrics(data["runs"])
    print(f"open {page}")


def _scenario(name, seconds, sets, seed):
    from drake_ispace.scenario import load_scenario, with_option

    scenario = load_scenario(name, sets or [])
    for option, value in (("seconds", seconds), ("seed", seed)):
        if value is not None:
            scenario = with_option(scenario, option, value)
    return scenario


def _diagram(name, scenario):
    from drake_ispace.scenario import blaming
    from drake_ispace.wiring.catalog import build_diagram

    with blaming(name):
        return build_diagram(scenario)


def _recording_folders(diagram, out):
    """Robot -> the folder of its recording, each checked before the run."""
    from drake_ispace.recording import check_place

    ports = [diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())]
    robots = [port.removesuffix("_pose") for port in ports if port.endswith("_pose")]
    if len(robots) > 1 and (out / "recording.yaml").exists():
        raise InputError(f"{out}: is a recording, expected a folder for those of {' and '.join(robots)}")
    folders = {robot: out if len(robots) == 1 else out / robot for robot in robots}
    for folder in folders.values():
        check_place(folder)
    return folders


def _print_json(data) -> None:
    json.dump(data, sys.stdout, indent=2, allow_nan=False)
    print()


def _print_metrics(runs) -> None:
    shown = {
        "rms_position_error_m": ("rms error", 1e3, "mm"), "max_position_error_m": ("max", 1e3, "mm"),
        "rms_cross_track_m": ("cross-track", 1e3, "mm"), "mean_lag_m": ("lag", 1e3, "mm"),
        "overshoot_percent": ("overshoot", 1.0, "%"), "time_to_end_s": ("to the end", 1.0, "s"),
        "iae_m_s": ("IAE", 1.0, "m s"),
    }
    rows = []
    for name, metrics in runs.items():
        cells = ["-" if metrics[key] is None else f"{scale * metrics[key]:.1f} {unit}"
                 for key, (_, scale, unit) in shown.items()]
        rows.append([name, *cells, f"lost at {metrics['diverged_at_s']:.2f} s" if metrics["diverged"] else "ok"])
    _table(["run", *[title for title, _, _ in shown.values()], ""], rows)


def _table(titles, rows) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(*titles)
    for row in rows:
        table.add_row(*map(str, row))
    Console(width=None if sys.stdout.isatty() else 140).print(table)


@contextmanager
def _progress(total, title):
    """A bar on standard error, where that is a terminal; yields a function that takes what is done so far."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(title, total=total)

        def advance(done):
            if isinstance(done, str):
                progress.update(task, description=done)
            else:
                progress.update(task, completed=done)

        yield advance
