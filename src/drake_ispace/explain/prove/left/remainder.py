"""A part of the gap that an answer leaves and that is not noise of a sound robot, and how it is told."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.prove.errors.free_run import Measure, rms

NOTHING = "nothing measured"


@dataclass(frozen=True)
class Remainder:
    """A part of the gap that the answer leaves and that is not noise of a sound robot.

    Attributes:
        channel: sensor and quantity, "position" or "heading", or "force" and its coordinate.
        driver: measured variable that it goes with, or "nothing measured".
        size, unit: root mean square over the horizon. horizon: such as "0.2s". ratio: how many times as large as it
            may be. since: in words. runs: those in which it is largest. Either may be empty, where it is no part of the
            test. because: the test that it fails, in words.
    """

    channel: str
    driver: str
    size: float
    unit: str
    horizon: str
    ratio: float
    since: str
    runs: list[str]
    because: str


@dataclass(frozen=True)
class Series:
    """Errors of one run in time: t (k,) [s], errors (k, d), motion (k, c) and drivers name -> (k, c) as measured."""

    t: np.ndarray
    errors: np.ndarray
    motion: np.ndarray
    drivers: Mapping[str, np.ndarray]


def going_with(
    m: Measure, runs: Sequence[tuple[str, Series]], driver: str, size: float, ratio: float, because: str
) -> Remainder:
    """The Remainder of an error that goes with a driver; runs: name and errors of each."""
    names, series = zip(*runs, strict=True)
    worst = worst_runs([rms([run.errors]) for run in series], names)
    return Remainder(m.channel, driver, size, m.unit, m.horizon, ratio, since_when(series), worst, because)


def worst_runs(sizes: Sequence[float], names: Sequence[str]) -> list[str]:
    """The runs whose error is at least that of all, the largest first."""
    order = np.argsort(sizes)[::-1]
    return [names[k] for k in order if sizes[k] >= np.sqrt(np.mean(np.square(sizes)))][:3] or names[:1]


def since_when(runs: Sequence[Series]) -> str:
    """Since when the squared error is there, in words."""
    times = np.concatenate([run.t / max(run.t[-1], 1e-9) for run in runs])
    return since(times, np.concatenate([np.sum(run.errors**2, axis=1) for run in runs]))


def since(times: np.ndarray, amounts: np.ndarray) -> str:
    """Since when something is there, in words: amounts (k,) of it at times (k,), in shares of a run."""
    by_tenth = np.histogram(times, bins=10, range=(0.0, 1.0), weights=amounts)[0]
    late = np.cumsum(by_tenth) / max(by_tenth.sum(), 1e-300)
    if late[2] < 0.05:
        return f"from about {10 * int(np.argmax(late > 0.05))} % of a run on"
    return "mostly in the first third of a run" if late[2] > 0.6 else "from the start of a run"


def amount(value: float, unit: str) -> str:
    """A number with its unit; metres below one as millimetres."""
    if unit == "m" and abs(value) < 1.0:
        return f"{1e3 * value:.3g} mm"
    return f"{value:.3g} {unit}" if unit != "1" else f"{value:.3g}"
