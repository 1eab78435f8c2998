"""What the scripts on real measurements share: options, which runs, how an answer is printed."""

import argparse
import json
import sys
from pathlib import Path

import drake_ispace as di
from drake_ispace.blocks.errors import InputError
from drake_ispace.files.importers import optiodom


def asked(description: str, chosen_effects: bool = False, **more: str) -> argparse.Namespace:
    """data, json, runs from the command line; tell(text) prints progress unless --json.

    chosen_effects: whether those to try can be chosen, `effects` then; None: the whole library.
    more: further options that are there or not, name -> what they do.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    folder = Path(__file__).parents[1] / ".." / "shared" / "data"
    parser.add_argument("--data", type=Path, default=folder, help="folder of the measurements, default ../shared/data")
    parser.add_argument("--json", action="store_true", help="print the answer as JSON alone")
    parser.add_argument("--runs", type=int, help="use so many runs at most of each kind of motion, default all")
    for name, text in more.items():
        parser.add_argument(f"--{name}", action="store_true", help=text)
    if chosen_effects:
        known = di.effects()
        parser.add_argument("--effects", nargs="+", choices=known, metavar="NAME", help="try these only, default all")
    options = parser.parse_args()
    if chosen_effects:
        options.effects = options.effects and [known[name] for name in options.effects]
    if not options.data.is_dir():
        parser.exit(2, f"{options.data}: expected the folder of real measurements, there is none\n")
    sys.excepthook = _refuse
    options.tell = lambda text: None if options.json else print(f"  {text}", file=sys.stderr)
    return options


def _refuse(kind, error, trace):
    """Show bad input as the command line does: one sentence and exit code 2."""
    if not issubclass(kind, InputError):
        sys.__excepthook__(kind, error, trace)
        return
    print(error, file=sys.stderr)
    sys.exit(2)


def spread(runs: list, count: int | None) -> list:
    """`count` of the runs, evenly taken from the first on; None: all."""
    return runs if count is None or count >= len(runs) else [runs[i * len(runs) // count] for i in range(count)]


def optiodom_runs(options: argparse.Namespace, robot: str, *kinds: str) -> dict[str, list]:
    """Kind of motion -> runs of an OptiOdom robot."""
    folder = options.data / "optiodom" / robot
    return {
        kind: [optiodom.load_run(file) for file in spread(optiodom.runs_in(folder / kind), options.runs)]
        for kind in kinds
    }


def show(options: argparse.Namespace, answer, **further) -> None:
    """An Explanation, and what else was measured, as JSON or in lines."""
    if options.json:
        print(json.dumps(answer.to_data() | further, indent=2, allow_nan=False))
        return
    print(answer)
    for name, value in further.items():
        print(f"  {name}: {json.dumps(value)}")
