"""What the scripts of this folder share: their options, many runs in a few processes, and tables."""

import argparse
import json
import os
import resource
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import drake_ispace as di
from drake_ispace.metrics import measure
from drake_ispace.simulation import Run

# Drake does not free a Diagram with Python blocks, so the processes are replaced now and then. (The executor's own
# max_tasks_per_child hangs under Python 3.11.)
_RUNS_PER_PROCESS = 25
TINY_S = 1.1  # simulated time of a run that is only to run; way points begin to move after 1 s


@dataclass(frozen=True)
class Job:
    """One run.

    Attributes:
        label: any key that can be hashed; results come back under it.
        scenario: name of a packaged scenario.
        overrides: "key=value" over it, as for `drake-ispace simulate --set`.
    """

    label: object
    scenario: str
    overrides: tuple[str, ...] = ()


def summary(run: Run) -> dict:
    """The metrics of a run of one robot."""
    return measure(run, run.robots[0]).to_data()


def run_all(
    jobs: Iterable[Job], summarise: Callable[[Run], dict] = summary, at_most_s: float | None = None,
) -> dict[object, dict]:
    """label -> summarise(run) of every job; `summarise` is a function at the top level of a module.

    at_most_s: simulated time at which every run ends; so short ones are run in this process.
    """
    jobs, results = list(jobs), []
    if at_most_s is not None:
        return {job.label: _run(summarise, job, at_most_s) for job in jobs}
    workers = min(os.cpu_count() or 1, len(jobs))
    for batch in range(0, len(jobs), workers * _RUNS_PER_PROCESS):
        with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
            results += pool.map(partial(_run, summarise), jobs[batch : batch + workers * _RUNS_PER_PROCESS])
    return {job.label: result for job, result in zip(jobs, results, strict=True)}


def _run(summarise, job, at_most_s=float("inf")):
    scenario = di.load_scenario(job.scenario, job.overrides)
    scenario.seconds = min(scenario.seconds, at_most_s)
    return summarise(di.simulate(scenario))


def apart(measured: Callable, *arguments) -> object:
    """What `measured`, a function at the top level of a module, gives in a process of its own."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(measured, *arguments).result()


def peak_mb() -> float:
    """The most memory that this process has had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024.0**2 if sys.platform == "darwin" else 1024.0)


def options(description: str, **more: dict) -> argparse.Namespace:
    """json, quick, tiny, seed and figures from the command line, and `at_most_s`, as run_all takes it.

    more: further options, name -> arguments of argparse's add_argument. What is tiny is quick, too.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output, nothing else")
    parser.add_argument("--quick", action="store_true", help="fewer and shorter runs")
    parser.add_argument("--tiny", action="store_true", help="only to see that every part runs, in a few seconds")
    parser.add_argument("--seed", type=int, default=0, help="of every random draw, default 0")
    parser.add_argument("--figures", type=Path, help="folder to write pictures to; left out: none are drawn")
    for name, settings in more.items():
        parser.add_argument(f"--{name.replace('_', '-')}", **settings)
    asked = parser.parse_args()
    asked.quick |= asked.tiny
    asked.at_most_s = TINY_S if asked.tiny else None
    return asked


def values(**settings) -> tuple[str, ...]:
    """Overrides from keywords, "__" for a dot: values(omni__plant__mass_kg=8) is ("omni.plant.mass_kg=8",)."""
    return tuple(f"{key.replace('__', '.')}={_text(value)}" for key, value in settings.items())


def _text(value):
    if isinstance(value, float):
        return f"{value:.12f}"  # YAML reads 1e-05 as a word
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_text(float(entry)) for entry in value) + "]"
    return json.dumps(value)


def print_json(data: dict) -> None:
    json.dump(data, sys.stdout, indent=2, allow_nan=False)
    print()


def print_table(title: str, titles: list[str], rows: list[list]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(*titles, title=title, title_justify="left")
    for row in rows:
        table.add_row(*("-" if cell is None else str(cell) for cell in row))
    Console(width=None if sys.stdout.isatty() else 150).print(table)
