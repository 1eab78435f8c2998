"""Output of the commands: JSON, tables, a progress bar. rich is imported only where it is needed, for speed."""

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drake_ispace.blocks.errors import printable

_METRICS = {
    "rms_position_error_m": ("rms error", 1e3, "mm"), "max_position_error_m": ("max", 1e3, "mm"),
    "rms_cross_track_m": ("cross-track", 1e3, "mm"), "mean_lag_m": ("lag", 1e3, "mm"),
    "overshoot_percent": ("overshoot", 1.0, "%"), "time_to_end_s": ("to the end", 1.0, "s"),
    "iae_m_s": ("IAE", 1.0, "m s"),
}
_SPREAD = {
    "rms_position_error_m": ("rms error", 1e3, "mm"), "max_position_error_m": ("largest error", 1e3, "mm"),
    "rms_cross_track_m": ("rms cross-track", 1e3, "mm"), "final_error_m": ("final error", 1e3, "mm"),
    "iae_m_s": ("IAE", 1.0, "m s"), "control_effort": ("control effort", 1.0, "N² m² s"),
}


def say(*words: object, **how) -> None:
    """Print as `print` does, with nothing in it that a terminal would obey."""
    print(*(printable(str(word)) for word in words), **how)


def print_json(data: dict) -> None:
    """One JSON document; no NaN, no infinity."""
    json.dump(data, sys.stdout, indent=2, allow_nan=False)
    print()


def print_table(titles: list[str], rows: list[list]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*titles)
    for row in rows:
        table.add_row(*(Text(printable(str(cell))) for cell in row))  # a string with "[mm]" would be markup
    Console(width=None if sys.stdout.isatty() else 140).print(table)


def print_metrics(runs: dict[str, dict]) -> None:
    """A row per run: name -> `Metrics.to_data()`."""
    rows = []
    for name, metrics in runs.items():
        cells = ["-" if metrics[key] is None else f"{scale * metrics[key]:.1f} {unit}"
                 for key, (_, scale, unit) in _METRICS.items()]
        rows.append([name, *cells, f"lost at {metrics['diverged_at_s']:.2f} s" if metrics["diverged"] else "ok"])
    print_table(["run", *[title for title, _, _ in _METRICS.values()], ""], rows)


def print_spread(result: dict) -> None:
    """The result of `montecarlo` for reading."""
    rows = []
    for name, numbers in result["metrics"].items():
        robot, _, metric = name.rpartition(".")
        title, scale, unit = _SPREAD[metric]
        cells = ["-" if numbers[key] is None else f"{scale * numbers[key]:.4g}"
                 for key in ("median", "p05", "p95", "max")]
        rows.append([f"{robot} {title}".strip() + f" [{unit}]", *cells])
    print_table([f"{result['diagram']}, {result['seconds']:g} s", "median", "5 %", "95 %", "worst"], rows)
    runs, diverged = result["runs"], result["diverged"]
    speed = f", {result['realtime_factor']:,.0f} times real time" if result["realtime_factor"] else ""
    say(f"{diverged} of {runs} runs diverged ({100.0 * diverged / runs:.3g} %); {result['wall_s']:.1f} s{speed}")
    if result["out"]:
        say(f"rows and figure: {result['out']}")


@contextmanager
def progress(total: float | None, title: str, unit: str | None = None) -> Iterator[Callable[[float | str], None]]:
    """A bar on standard error, where that is a terminal; yields a function that takes what is done so far, or a title.

    unit: of what is done, as "runs", to show the rate.
    """
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, ProgressColumn

    class Rate(ProgressColumn):
        def render(self, task):
            return f"{task.speed:,.0f} {unit}/s" if task.speed else f"- {unit}/s"

    columns = [*Progress.get_default_columns(), *([MofNCompleteColumn(), Rate()] if unit else [])]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=total)

        def advance(done):
            if isinstance(done, str):
                bar.update(task, description=done)
            else:
                bar.update(task, completed=done)

        yield advance


@contextmanager
def stages(title: str) -> Iterator[Callable[[str], None]]:
    """A line on standard error per stage, where that is a terminal; yields a function that takes the name of the next
    stage. Every finished stage keeps its line, with the time that it took."""
    if not sys.stderr.isatty():
        yield lambda name: None
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(stderr=True)
    name, started = title, time.perf_counter()
    with console.status(Text(title)) as status:

        def tell(following):
            nonlocal name, started
            now = time.perf_counter()
            console.print(Text(f"{now - started:6.1f} s  {name}"))
            name, started = following, now
            status.update(Text(following))

        yield tell
        tell("done")
