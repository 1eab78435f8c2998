"""The command line. Heavy libraries are imported by the commands that use them: `--help` answers at once."""

import json
import math
import os
import signal
import sys
from collections.abc import Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter, UnusedCliTokensError

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.cli.check import register as register_check_command
from drake_ispace.cli.explain import register as register_explain_commands
from drake_ispace.cli.identify import register as register_identify_command
from drake_ispace.cli.logs import register as register_log_commands
from drake_ispace.cli.options import Json, Seconds, Seed, Sets, whole
from drake_ispace.cli.start import stopped
from drake_ispace.cli.terminal import print_json, print_metrics, print_spread, print_table, progress, say
from drake_ispace.cli.vision import register as register_vision_commands
from drake_ispace.files.places import check_folder

app = App(
    name="drake-ispace",
    help="Two robots in an intelligent space, as Drake Diagrams: simulate, compare and draw them.",
    suppress_keyboard_interrupt=False,
)


def main(arguments: Iterable[str] | None = None) -> None:
    """Entry point: 0 when done, 2 and one sentence on bad input, 130 on Ctrl-C."""
    try:
        with _interrupts():
            try:
                app(arguments, exit_on_error=False, print_error=False)
            finally:
                sys.stdout.flush()
    except UnusedCliTokensError as error:
        _refuse(f"unexpected {shown(' '.join(error.unused_tokens))}, expected only options after what it is about")
    except (InputError, CycloptsError) as error:
        _refuse(str(error))
    except KeyboardInterrupt as error:
        said = str(error) or "stopped, nothing half-written is left behind"
        say(f"drake-ispace: {said}", file=sys.stderr, flush=True)
        if arguments is None:
            os._exit(130)  # Python's own way out crashes where the import of Drake was interrupted
        sys.exit(130)
    except BrokenPipeError:
        _drop_output()
        sys.exit(1)
    except OSError as error:
        _drop_output()
        _refuse(f"{error.filename or 'standard output'}: cannot be written ({error.strerror or error})")


@contextmanager
def _interrupts():
    """Ctrl-C stays a KeyboardInterrupt where a library, such as numba while it compiles, makes something else of it."""
    seen = []

    def interrupt(number, frame):
        if _imports_drake(frame):
            stopped(number, frame)
        seen.append(number)
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:  # ignored, or somebody else's
        yield
        return
    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    except Exception:
        if seen:
            raise KeyboardInterrupt from None
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _imports_drake(frame):
    """Whether Drake is being imported, whose own code prints what it thinks of an interruption and goes on."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] == "pydrake" and frame.f_code.co_name == "<module>":
            return True
        frame = frame.f_back
    return False


def _refuse(sentence):
    say(" ".join(f"drake-ispace: {sentence}".split()), file=sys.stderr)
    sys.exit(2)


def _drop_output():
    """Discard buffered output that nobody reads any more, of which Python would complain when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@app.command(name="list")
def list_(*, as_json: Json = False) -> None:
    """List the Diagrams, the packaged scenarios and the effects that a model may lack."""
    from drake_ispace.effects.listing import cards
    from drake_ispace.scenario import scenario_names
    from drake_ispace.wiring.catalog import CATALOG

    if as_json:
        print_json({"diagrams": list(CATALOG), "scenarios": scenario_names(), "effects": cards()})
        return
    say("Diagrams")
    for name, entry in CATALOG.items():
        say(f"  {name:30} {entry.title}")
    say("Scenarios")
    for name in scenario_names():
        say(f"  {name}")
    say("Effects")
    for card in cards():
        say(f"  {card['name']:30} {card['title']}")


@app.command
def simulate(
    name: str, /, *, seconds: Seconds = None, set_: Sets = None, seed: Seed = None,
    out: Annotated[Path | None, Parameter(help="folder of the recording, truth included")] = None,
    engine: Annotated[Literal["drake", "compiled"], Parameter(help="the same numbers; compiled is faster")] = "drake",
    as_json: Json = False,
) -> None:
    """Simulate a scenario, given by name or YAML file, and optionally record it."""
    scenario = _scenario(name, seconds, set_, seed)
    diagram = _diagram(name, scenario)
    from drake_ispace.alignment import to_recording
    from drake_ispace.simulation import simulate_diagram

    folders = _recording_folders(scenario, out) if out is not None else {}
    with progress(scenario.seconds, scenario.diagram) as advance:
        if engine == "compiled":
            from drake_ispace.rollout.engine import simulate_compiled

            run = simulate_compiled(scenario, diagram)
        else:
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
        print_json(result)
        return
    factor = result["realtime_factor"]
    speed = f"{factor:.0f}" if factor >= 10.0 else f"{factor:.2g}"
    say(f"{scenario.diagram}: {simulated:g} s in {run.wall_s:.2f} s, {speed} times real time")
    if run.diverged_s is not None:
        say(f"the robot fell or was lost at {run.diverged_s:.3f} s")
    for robot, pose in final.items():
        say(f"{robot} ends at x = {pose['x']:.4f} m, y = {pose['y']:.4f} m, phi = {pose['phi']:.4f} rad")
    for folder in recordings.values():
        say(f"recording: {folder}")


@app.command
def draw(
    name: str, /, *, set_: Sets = None,
    out: Annotated[Path | None, Parameter(help="x.svg, x.png or x.dot; left out: the dot text is printed")] = None,
    depth: Annotated[int | None, Parameter(help="levels of nested Diagrams to open", converter=whole)] = None,
    kernel: Annotated[bool, Parameter(negative="", help="the function that it is compiled to, as text")] = False,
    as_json: Json = False,
) -> None:
    """Draw the wiring of a Diagram with Graphviz."""
    if depth is not None and not 0 <= depth <= 1000:
        raise InputError(f"--depth: expected 0 (closed) to 1000 levels, got {depth}")
    diagram = _diagram(name, _scenario(name, None, set_, None))
    from drake_ispace.report.pictures.drawing import dot_text
    from drake_ispace.report.pictures.drawing import draw as draw_diagram

    if out is not None:
        check_folder(out.parent)
        draw_diagram(diagram, out, depth)
    data = {"diagram": diagram.get_name(), "out": str(out) if out else None, "dot": dot_text(diagram, depth)}
    if kernel:
        from drake_ispace.rollout.compile import kernel_text

        data["kernel"] = kernel_text(diagram)
    if as_json:
        print_json(data)
    else:
        say(data["kernel"] if kernel else out if out is not None else data["dot"])


@app.command(name="schedule")
def schedule_(name: str, /, *, set_: Sets = None, as_json: Json = False) -> None:
    """Show every periodic update of a Diagram: which block, which phase, when."""
    diagram = _diagram(name, _scenario(name, None, set_, None))
    from drake_ispace.report.pictures.schedule import schedule

    rows = schedule(diagram)
    if as_json:
        print_json({"updates": rows})
        return
    print_table(
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
    from drake_ispace.comparison import compare as run_all

    total = sum(scenario.seconds for scenario in scenarios.values())
    with progress(total, "compare") as advance:
        order, span = list(scenarios), next(iter(scenarios.values())).seconds
        results = run_all(scenarios, lambda name, t: advance(order.index(name) * span + t))
    data = {"runs": {name: metrics.to_data() for name, (_, _, metrics) in results.items()}}
    if out is not None:
        from drake_ispace.report.pages import write_text
        from drake_ispace.report.pictures.plots import plot_comparison

        plot_comparison({name: (run, robot) for name, (run, robot, _) in results.items()}, out / "comparison.png")
        write_text(out / "comparison.json", json.dumps(data, indent=2))
    if as_json:
        print_json(data)
        return
    print_metrics(data["runs"])
    if out is not None:
        say(f"plot: {out / 'comparison.png'}")


@app.command
def montecarlo(
    name: str, /, *, runs: Annotated[int, Parameter(help="how many", converter=whole)] = 100,
    vary: Annotated[
        list[str] | None,
        Parameter(negative="", help="key=normal(mean,std), uniform(a,b), loguniform(a,b) or choice(a,b,...)"),
    ] = None,
    seconds: Seconds = None, seed: Seed = None, set_: Sets = None,
    threads: Annotated[int | None, Parameter(help="runs at once, default one per core", converter=whole)] = None,
    cluster: Annotated[str | None, Parameter(help="a Dask scheduler, as tcp://host:8786, instead of threads")] = None,
    out: Annotated[Path | None, Parameter(help="folder of rows and figure; the same call resumes it")] = None,
    parameters: Annotated[bool, Parameter(negative="", help="list what can be varied, with its value")] = False,
    as_json: Json = False,
) -> None:
    """Run a scenario many times with varied parameters and noise: the spread of its tracking error."""
    scenario = _scenario(name, seconds, set_, seed)
    _diagram(name, scenario)
    from drake_ispace.rollout.many.campaign import montecarlo as run_all
    from drake_ispace.rollout.many.campaign import parameters_of
    from drake_ispace.rollout.many.draws import split_vary
    from drake_ispace.rollout.many.table import spread

    if parameters:
        values = parameters_of(scenario)
        if as_json:
            print_json({key: value if math.isfinite(value) else None for key, value in values.items()})
        else:
            print_table(["parameter", "value"], [[key, f"{value:.6g}"] for key, value in values.items()])
        return
    with progress(runs, scenario.diagram, "runs") as advance:
        campaign = run_all(
            scenario, runs, vary=split_vary(vary or []), seed=scenario.seed, out=out, threads=threads, cluster=cluster,
            progress=lambda done, total: advance(done),
        )
    if out is not None:
        from drake_ispace.report.pictures.montecarlo_plot import plot_campaign

        plot_campaign(campaign, out / "montecarlo.png")
    simulated = campaign.runs_now * scenario.seconds
    result = {
        "diagram": scenario.diagram, "runs": runs, "seconds": scenario.seconds,
        "diverged": sum(campaign.table["diverged"].to_pylist()), "metrics": spread(campaign.table, campaign.metrics),
        "wall_s": campaign.wall_s, "realtime_factor": simulated / campaign.wall_s if campaign.runs_now else None,
        "out": str(out) if out is not None else None, "damaged": [str(file) for file in campaign.damaged],
    }
    if as_json:
        print_json(result)
        return
    for file in campaign.damaged:
        say(f"{file}: could not be read, its runs were computed again", file=sys.stderr)
    print_spread(result)


@app.command(name="parity")
def parity_(
    name: str, /, *, seconds: Seconds = 20.0, set_: Sets = None, seed: Seed = None, as_json: Json = False,
) -> None:
    """Compare Drake's Simulator with the compiled rollout, every output at every tick."""
    scenario = _scenario(name, seconds, set_, seed)
    diagram = _diagram(name, scenario)
    from drake_ispace.rollout.engine import parity

    result = parity(scenario, diagram)
    if as_json:
        print_json(result)
        return

    def said(gap):
        return "not comparable" if gap is None else f"{gap:.3g}"

    print_table(["output", "largest difference"], [[key, said(gap)] for key, gap in result["signals"].items()])
    say(f"{result['diagram']}: {said(result['max_abs_difference'])} at most over {result['ticks']} ticks")


@app.command
def demo(
    *, seconds: Seconds = None, seed: Seed = None,
    out: Annotated[Path, Parameter(help="folder of the pages")] = Path("demo"), as_json: Json = False,
) -> None:
    """Drive both robots through the space and write a folder with pictures and an index page."""
    from drake_ispace.report.demo import write_demo

    with progress(None, "demo") as advance:
        page, data = write_demo(out, seconds, seed, advance)
    if as_json:
        print_json(data | {"page": str(page)})
        return
    print_metrics(data["runs"])
    say(f"open {page}")
    for line in data["explained"].get("lines", ()):
        say(line)


register_check_command(app)
register_explain_commands(app)
register_identify_command(app)
register_vision_commands(app)
register_log_commands(app)


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


def _recording_folders(scenario, out):
    """Robot -> the folder of its recording, each checked before the run."""
    from drake_ispace.files.recording import check_place
    from drake_ispace.wiring.catalog import entry_of

    robots = entry_of(scenario).robots
    if len(robots) > 1 and (out / "recording.yaml").exists():
        raise InputError(f"{out}: is a recording, expected a folder for those of {' and '.join(robots)}")
    folders = {robot: out if len(robots) == 1 else out / robot for robot in robots}
    for folder in folders.values():
        check_place(folder)
    return folders
