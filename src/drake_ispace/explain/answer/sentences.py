"""The gap and what is left of it, in sentences a user can act on."""

import math
import sys
from pathlib import Path

from drake_ispace.explain.prove.errors.free_run import PREDICTION, RUN, STEP
from drake_ispace.explain.prove.errors.gap import GapRow
from drake_ispace.explain.prove.left.remainder import NOTHING, Remainder, amount

_OVER = {RUN: "over whole runs", STEP: "at the next sample"}
_BY = {"wheels": "dead-reckoned", "torque": "simulated on the recorded torque", "command": "simulated on the command",
       "reference": "in closed loop along the reference"}


def gap_sentence(row: GapRow | None, proof: str, has_effects: bool, holds_unexplained: bool = False) -> str:
    """The headline: errors before and after on unseen runs, and the share closed if it is known; empty where there is
    nothing to say.

    row: None where the gap is small beside what noise may leave. holds_unexplained: whether the noise is as strong as
    the runs need, while something is still unexplained.
    """
    if row is None:
        small = "the gap in metres is small beside what noise may leave"
        return (small if proof else "no run was held out to prove it on") if has_effects else ""
    where = f"{proof or 'unseen runs'}{f', {row.kind}' if row.kind else ''}"
    by = "" if row.channel.startswith("simulated") else _BY.get(row.driven_by, "")
    what = f"{row.channel} {by} {over(row.horizon)}".replace("  ", " ")
    if not has_effects:
        return f"{where}: {what} is off by {amount(row.before, row.unit)}"
    before, after, noise = (amount(x, row.unit) for x in (row.before, row.after, math.hypot(row.sensors, row.chance)))
    noise += ", with what is still unexplained in it" if holds_unexplained else ""
    share = "" if row.closed is None else f": {100.0 * row.closed + 0.0:.0f} % of the gap closed".replace("-0 %", "0 %")
    return f"{where}: {what} was off by {before}, is off by {after}, of which noise may be {noise}{share}"


def p_in_words(p_value: float) -> str:
    """A probability as "p = 0.012"; one that is too small for a number is not zero."""
    least = sys.float_info.min
    return f"p < {least:.0g}" if p_value < least else f"p = {p_value:.2g}"


def short(row: GapRow) -> str:
    """A row of the gap on one line."""
    kind = f", {row.kind}" if row.kind else ""
    floor = [f"{name} {amount(value, row.unit)}" for name, value in (
        ("sensors", row.sensors), ("chance", row.chance), ("least squares", row.least_squares)) if value is not None]
    errors = [amount(row.before, row.unit)] + ([amount(row.after, row.unit)] if row.after != row.before else [])
    measure = f"{row.metric} {row.horizon}{kind}, {row.channel} ({row.driven_by})"
    return f"{measure}: {' -> '.join(errors)}" + (f" ({', '.join(floor)})" if floor else "")


def is_place(row: GapRow) -> bool:
    """Whether a row is of a position, or of the wheels of a plant without a place."""
    return row.metric != PREDICTION and row.channel != "heading"


def sentence_of(remainder: Remainder) -> str:
    """A sentence on a Remainder: channel, size, what it goes with, since when, and in which runs."""
    since = f", {remainder.since}" if remainder.since else ""
    runs = f"; most in {most_in(remainder)}" if remainder.runs else ""
    goes = "with nothing measured" if remainder.driver == NOTHING else f"with {remainder.driver}"
    size = amount(remainder.size, remainder.unit)
    return (
        f"{remainder.channel}: {size} {over(remainder.horizon)}, goes {goes}{since} ({remainder.because}){runs}"
    ).replace(" ,", ",")


def most_in(remainder: Remainder) -> str:
    """The runs in which it is largest, each by its file and folder."""
    return ", ".join(run_name(run) for run in remainder.runs)


def run_name(run: str) -> str:
    """A run by its file and folder."""
    return "/".join(Path(run).parts[-2:])


def over(horizon: str) -> str:
    """A horizon in words."""
    return _OVER.get(horizon, f"over {horizon.removesuffix('s')} s" if horizon else "")
