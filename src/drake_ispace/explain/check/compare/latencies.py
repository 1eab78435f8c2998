"""Is the camera late in one run by another time than in the others? It has one latency, so that a clock was off."""

from collections.abc import Iterator, Sequence

import numpy as np

from drake_ispace.explain.check.compare.agreement import SAID
from drake_ispace.explain.check.compare.links import LATENCIES_S, RATE_S
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Clock


def other_latencies(numbers: Sequence[int], scores: Sequence[np.ndarray]) -> Iterator[Finding]:
    """Findings of runs whose camera is late or early by a usual time, but not by that of most runs.

    In most of three runs or more its lags must lie within RATE_S of their median.

    numbers: of the runs. scores: of each, (lags,) log likelihood of each of LATENCIES_S.
    """
    lags_s = np.array([LATENCIES_S[np.argmax(of_run)] for of_run in scores])
    for i, (number, of_run) in enumerate(zip(numbers, scores, strict=True) if len(numbers) > 2 else ()):
        others_s = float(np.median(np.delete(lags_s, i)))
        off_s, alike = float(lags_s[i]) - others_s, np.sum(np.abs(lags_s - others_s) <= RATE_S)
        gain = float(of_run.max() - np.interp(others_s, LATENCIES_S, of_run))
        if abs(off_s) > RATE_S and 2 * alike > len(numbers) and gain >= SAID:
            what = f"clock {abs(off_s):.3g} s {'late' if off_s < 0 else 'early'} against that of the other runs"
            yield Finding(
                "clock_offset", what, "kinect", drop_in_deviance=2.0 * gain, runs=(number,),
                repairs=(Clock("kinect", 1.0, off_s),),
            )
