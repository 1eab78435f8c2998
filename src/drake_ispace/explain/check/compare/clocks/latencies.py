"""Is a channel late in one run by another time than in the others? A camera has one latency: a clock was off.

A drive may lag by other times, but never leads its command.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from drake_ispace.explain.check.compare.agreement import SAID
from drake_ispace.explain.check.compare.clocks.paths import OFFSET
from drake_ispace.explain.check.compare.links import LATENCIES_S, RATE_S
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Clock
from drake_ispace.robots.robot import COMMAND


def other_latencies(channel: str, numbers: Sequence[int], scores: Sequence[np.ndarray]) -> Iterator[Finding]:
    """Findings of runs whose camera or command is late or early by a usual time, but not by that of most other runs.

    These must lie within RATE_S of their median, and as clearly not have the time of the run. Runs that tell no time
    are left out. By what is then repaired a model can be judged.

    numbers: of the runs. scores: of each, (lags,) log likelihood of each of LATENCIES_S.
    """
    told = [i for i, of_run in enumerate(scores) if of_run.any()]
    numbers, scores = [numbers[i] for i in told], [scores[i] for i in told]
    lags_s = np.array([LATENCIES_S[np.argmax(of_run)] for of_run in scores])

    def speaks_against(of_run, lag_s):
        return of_run.max() - np.interp(lag_s, LATENCIES_S, of_run)

    for i, (number, of_run) in enumerate(zip(numbers, scores, strict=True) if len(numbers) > 2 else ()):
        others = [j for j in range(len(numbers)) if j != i]
        usual_s = float(np.median(lags_s[others]))
        off_s, gain = float(lags_s[i]) - usual_s, float(speaks_against(of_run, usual_s))
        alike = sum(abs(lags_s[j] - usual_s) <= RATE_S and speaks_against(scores[j], lags_s[i]) >= SAID for j in others)
        may_tell = channel != COMMAND or of_run.max() - of_run[LATENCIES_S > -RATE_S - 1e-9].max() >= SAID
        if may_tell and abs(off_s) > RATE_S and 2 * alike > len(others) and gain >= SAID:
            later = "later" if off_s < 0 else "earlier"
            what = f"clock {abs(off_s):.3g} s {later} against the wheels' than in the other runs"
            yield Finding(
                OFFSET, what, channel, drop_in_deviance=2.0 * gain, runs=(number,),
                repairs=(Clock(channel, 1.0, off_s),), harmless=True,
            )
