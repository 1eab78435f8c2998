"""What a clock may do: be off, drift or jump."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.explain.check.compare.links import LATENCIES_S, LATENCY_S, RATE_S, lags

LATEST_S = 5.0  # by which a clock may be off that is looked for
LAGS_S = lags(LATEST_S, RATE_S)
_FASTEST = 0.05  # rate at which a clock may drift
OFFSET = "clock_offset"  # name of a clock that is off by the same throughout


@dataclass(frozen=True)
class Path:
    """Times t of a channel on the wheels' clock: t + lag_s + rate (t - middle_s), and later_s more from jump_s on."""

    lag_s: float = 0.0
    rate: float = 0.0
    middle_s: float = 0.0
    later_s: float = 0.0
    jump_s: float = np.inf

    def at(self, t: np.ndarray) -> np.ndarray:
        """(n,) times [s] on the wheels' clock."""
        return times_along([self], t)[0]

    @property
    def fault(self) -> str:
        """Name of the mistake."""
        return "clock_jump" if self.later_s else "clock_drift" if self.rate else OFFSET

    def shifted(self) -> list["Path"]:
        """The path with every lag near its own."""
        return [replace(self, lag_s=self.lag_s + float(d)) for d in LATENCIES_S]

    def jumping(self, at: np.ndarray) -> list["Path"]:
        """The path with its jump at other times (n,) [s]."""
        return [replace(self, jump_s=float(jump_s)) for jump_s in at]

    def later(self) -> list["Path"]:
        """The path with every size of its jump near its own."""
        return [replace(self, later_s=self.later_s + float(d)) for d in LATENCIES_S]

    def tilted(self, lasts_s: float) -> list["Path"]:
        """The path with every rate near its own: from one to the next by a tick more during a run that lasts so long.
        """
        near = self.rate + LATENCIES_S / lasts_s
        return [replace(self, rate=float(rate)) for rate in near[np.abs(near) <= _FASTEST]] or [self]

    def number_in(self, paths: Sequence["Path"]) -> int:
        """The number of the path whose rate is next to its own."""
        return int(np.argmin([abs(path.rate - self.rate) for path in paths]))


def times_along(paths: Sequence[Path], t: np.ndarray) -> np.ndarray:
    """(paths, n) times [s] on the wheels' clock; t: (n,) of the channel."""
    lag_s, rate, middle_s, later_s, jump_s = np.array([
        (path.lag_s, path.rate, path.middle_s, path.later_s, path.jump_s) for path in paths
    ]).T[:, :, None]
    return t + lag_s + rate * (t - middle_s) + np.where(t >= jump_s, later_s, 0.0)


Losses = Callable[[Sequence[Path]], np.ndarray]


def least(paths: Sequence[Path], losses_of: Losses) -> Path:
    """The path with the least loss, of equal ones the middle one; losses_of: gives those of several."""
    losses = losses_of(paths)
    equal = np.flatnonzero(losses == losses.min())
    return paths[int(equal[len(equal) // 2])]


def descended(losses: np.ndarray, at: int) -> int:
    """The number of the loss to which all lead down from number `at`.

    Far from it windows leave the run, and a loss is of fewer of them.
    """
    while True:
        near = range(max(at - 1, 0), min(at + 2, len(losses)))
        lower = min(near, key=lambda i: losses[i])
        if not losses[lower] < losses[at]:
            return at
        at = lower


def is_at_end(lag: int) -> bool:
    """Whether the lag of this number is the first or last that is looked at, beyond which a better one may be."""
    return lag in (0, len(LAGS_S) - 1)


def rates_of(lasts_s: float) -> list[float]:
    """Rates at which a clock may drift: from one to the next by a latency more during a run that lasts so long.

    Of a longer run than one in which the fastest clock passes all offsets that are looked at, as many as of that one.
    """
    return lags(_FASTEST, LATENCY_S / min(lasts_s, np.ptp(LAGS_S) / _FASTEST)).tolist()
