"""`drake-ispace identify`: friction coefficients and linear model of the pendulum from a recorded run."""

import json
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from drake_ispace.cli.options import Json
from drake_ispace.cli.terminal import print_json, print_table, say
from drake_ispace.files.places import check_folder


def register(app: App) -> None:
    """Add the command of this module."""
    app.command(identify)


def identify(
    run: Path, /, *,
    structure: Annotated[
        Literal["arx", "armax", "armaxd", "iv", "pem"], Parameter(help="model of the noise, or method")
    ] = "arx",
    out: Annotated[Path | None, Parameter(help="folder for identification.json and convergence.png")] = None,
    as_json: Json = False,
) -> None:
    """Identify the pendulum's linear model and its friction from a recorded run: Table 4.1, (4.8)-(4.9)."""
    from drake_ispace.robots.recordings import load

    recording = load(run)
    if out is not None:
        check_folder(out)
    from drake_ispace.thesis.identify import identify_run

    result = identify_run(recording, structure)
    data = {"run": str(run), **result.to_data(), "out": str(out) if out is not None else None}
    if out is not None:
        from drake_ispace.report.pages import write_text
        from drake_ispace.report.pictures.identification_plots import plot_convergence

        write_text(out / "identification.json", json.dumps(data, indent=2))
        plot_convergence({structure: result.estimate}, result.seconds, out / "convergence.png")
    if as_json:
        print_json(data)
        return
    print_table(["coefficient", "value", "95 % interval"], [
        [f"{row['of']} in {row['in']}", f"{row['value']:.5g}", f"{row['low']:.5g} .. {row['high']:.5g}"]
        for row in data["coefficients"]
    ])
    friction = data["friction"]
    say(f"Coulomb {friction['coulomb_n_m']:.5f} ± {friction['coulomb_std']:.5f} N*m, "
        f"viscous {friction['viscous_n_m_s']:.5f} ± {friction['viscous_std']:.5f} N*m*s/rad (one standard deviation)")
    for test in data["residual_tests"]:
        white = "white" if test["white"] else "not white"
        tie = "independent of" if test["independent"] else "correlated with"
        say(f"residual of {test['output']}: {white} (p = {test['whiteness_p']:.2g}), {tie} the regressors")
    for note in data["notes"]:
        say(f"note: {note}")
    if out is not None:
        say(f"written: {out / 'identification.json'}, {out / 'convergence.png'}")
