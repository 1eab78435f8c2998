"""The command `check`: do recordings agree with each other, before any physics is asked for?"""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.cli.options import Json, Sets
from drake_ispace.cli.terminal import print_json, say, stages
from drake_ispace.files.places import check_folder, check_own_folder


def register(app: App) -> None:
    """Add the command of this module to the app."""
    app.command(check)


def check(
    *runs: Path,
    model: Annotated[
        str | None, Parameter(help="scenario that describes the robot: a name or YAML file; left out: the runs' own")
    ] = None,
    repair: Annotated[Path | None, Parameter(help="folder of repaired copies; the runs stay as they are")] = None,
    out: Annotated[Path | None, Parameter(help="folder of a page with a picture of each finding")] = None,
    set_: Sets = None, as_json: Json = False,
) -> None:
    """Find mistakes of recordings: units, signs, swapped columns, clocks, a robot carried by hand."""
    if not runs:
        raise InputError("check: expected the folder of at least one run")
    if out is not None:
        check_own_folder(out, "the page of a check")
    if repair is not None:
        check_folder(repair)
    from drake_ispace.robots.recordings import load
    from drake_ispace.scenario import load_scenario

    recordings = [load(run) for run in runs]
    scenario = load_scenario(model if model is not None else _own_model(recordings[0]), set_ or [])
    with stages("checking the recordings") as tell:
        from drake_ispace.explain.check.check import check as check_runs

        checked = check_runs(scenario, recordings, tell)
        if out is not None:
            from drake_ispace.report.check_page import write_findings

            write_findings(checked, scenario, recordings, out)
    copies = []
    if repair is not None:
        from drake_ispace.explain.check.repaired import save_repaired

        copies = save_repaired(checked, recordings, repair)
    if as_json:
        data = [finding.to_data() for finding in checked.findings]
        written = [str(copy) for copy in copies]
        print_json({"runs": checked.names, "compared": checked.compared, "data": data, "repaired": written})
        return
    say(str(checked))
    if model is None and checked.findings:
        say(f"compared with the model {scenario.diagram}, which the run names; for another robot use --model")
    for copy in copies:
        say(f"written: {copy}")
    if out is not None:
        say(f"open {out / 'index.html'}")


def _own_model(recording):
    """The scenario that a recording names, or that of its robot."""
    from drake_ispace.robots.library import robots
    from drake_ispace.scenario import scenario_names

    if recording.scenario in scenario_names():
        return recording.scenario
    if recording.robot in robots():
        return robots()[recording.robot].diagram
    raise InputError(
        f"{recording.path}: the run is of robot {shown(recording.robot)}, which has no scenario, expected --model"
    )
