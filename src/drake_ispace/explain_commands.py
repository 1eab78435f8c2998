"""The commands on what a model lacks: `explain` measured runs, and `hide` effects in recordings to try it on. Imported
by cli.py; heavy libraries are imported inside."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from drake_ispace.cli_options import Json, Seconds, Seed, Sets, whole
from drake_ispace.errors import InputError, shown
from drake_ispace.places import check_own_folder
from drake_ispace.terminal import print_json, progress, stages


def register(app: App) -> None:
    """Add the commands of this module."""
    app.command(explain)
    app.command(hide)


def explain(
    *runs: Path, model: Annotated[str, Parameter(help="scenario that should describe the robot: a name or YAML file")],
    held_out: Annotated[
        list[Path] | None,
        Parameter(negative="", consume_multiple=True, help="runs that the answer is proved on, best of another motion"),
    ] = None,
    out: Annotated[Path | None, Parameter(help="folder of the report: page, pictures, new scenario")] = None,
    seed: Seed = None, set_: Sets = None, as_json: Json = False,
) -> None:
    """Find which physical effect a model lacks, from measured runs, and prove that adding it closes the gap."""
    held_out = held_out or []
    seed = _checked_seed(seed)
    _check_runs(runs, held_out)
    if out is not None:
        check_own_folder(out, "explanation.json", "an explanation")
    from drake_ispace.recording import load
    from drake_ispace.scenario import load_scenario

    scenario = load_scenario(model, set_ or [])
    recordings, others = [load(run) for run in runs], [load(run) for run in held_out]
    _check_fit(scenario, model, [*zip(runs, recordings, strict=True), *zip(held_out, others, strict=True)])
    with stages("reading the library of effects") as tell:
        from drake_ispace.discrepancy.explain import explain as explain_runs

        found = explain_runs(scenario, recordings, held_out=others, seed=seed, tell=tell)
        if out is not None:
            from drake_ispace.report.explain_page import write_explanation

            found = write_explanation(found, scenario, recordings, others, out, tell)
    if as_json:
        print_json(found.to_data())
        return
    print(found)
    if out is not None:
        print(f"open {out / 'index.html'}")


def hide(
    scenario: str, /, *,
    effect: Annotated[list[str] | None, Parameter(negative="", help="name:parameter=value,...; may be repeated")] = None,
    out: Annotated[Path, Parameter(help="folder of the recordings and the answer")],
    runs: Annotated[int, Parameter(help="how many; kinds of motion take turns", converter=whole)] = 4,
    robot: Annotated[str | None, Parameter(help="of a Diagram with two")] = None,
    seconds: Seconds = 20.0, seed: Seed = None, set_: Sets = None, as_json: Json = False,
) -> None:
    """Make recordings with effects inside that nothing in them gives away, and the answer in a file of its own."""
    seed = _checked_seed(seed)
    if not 1 <= runs <= 1000:
        raise InputError(f"--runs: expected 1 to 1000, got {runs}")
    check_own_folder(out, "", "hidden effects")
    from drake_ispace.scenario import load_scenario, with_option

    given = with_option(load_scenario(scenario, set_ or []), "seconds", seconds)
    effects = _read_effects(effect or [])
    from drake_ispace.discrepancy.hide import MOTIONS, check_hidden, save_hidden
    from drake_ispace.discrepancy.hide import hide as hide_in

    robot = robot or _robots(given, scenario)[0]
    effects = check_hidden(given, robot, effects, "--effect")
    kinds = [list(MOTIONS)[i % len(MOTIONS)] for i in range(runs)]
    hidden = {}
    with progress(runs, "hide", "runs") as advance:
        for i, motion in enumerate(kinds):
            name = motion if i < len(MOTIONS) else f"{motion}_{i // len(MOTIONS) + 1}"
            hidden[name] = hide_in(given, robot, effects, [motion], seed + 1009 * i, seconds)[motion]
            advance(i + 1)
    digest = save_hidden(hidden, robot, effects, seed, out)
    recordings = {name: str(out / name) for name in hidden}
    if as_json:
        print_json({"recordings": recordings, "answer": str(out / "answer.json"), "sha256": digest})
        return
    for path in recordings.values():
        print(path)
    print(f"answer: {out / 'answer.json'}, SHA-256 {digest}")
