"""Torques and IMU samples of the controller's steps that a log does not have.

A robot's controller reads its IMU and sets its torques at every tick. Whatever it did at ticks that are not in the log
goes round the loop: later torques answer to it, and the answer looks like physics that the model lacks. Angles of
wheels are smooth enough to be known between their samples.
"""

from collections.abc import Iterator

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.links import FEWEST
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.sampling.samples import come_in_step, repeats
from drake_ispace.explain.check.sampling.stamps import are_gaps
from drake_ispace.faults.repair import Without
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import TORQUE, Robot

_SELDOM = 0.02  # share of the ticks that may be missing


def tick_findings(run: Recording, robot: Robot) -> Iterator[Finding]:
    """Channels without a sample at many of the ticks at which the controller of a robot under torque uses them."""
    if robot.driven != TORQUE or not robot.in_room:
        return
    for name in (TORQUE, "imu") if robot.has_imu else (TORQUE,):
        if name in run.channels and len(run.channels[name].t) > FEWEST:
            yield from _of_channel(name, run.channels[name])


def _of_channel(name, channel) -> Iterator[Finding]:
    ticks, first = np.unique(np.round(channel.t / TICK_S), return_index=True)
    steps, again = np.diff(ticks), repeats(channel.values[first])
    within = ~are_gaps(TICK_S * steps)  # which are told by themselves
    if not within.any():
        return
    held = come_in_step(again)
    shown = within & ~again if held and name == "imu" else within  # an IMU is never the same twice
    missing = 1.0 - shown.sum() / steps[within].sum()
    if missing > _SELDOM and 2 * shown.sum() <= steps[within].sum() and 2 * again[shown].sum() < shown.sum():
        step_ms = 1e3 * TICK_S * steps[within].sum() / shown.sum()
        what = f"a sample every {step_ms:.3g} ms, the model's controller acts every {1e3 * TICK_S:.3g} ms"
        yield Finding("undersampled", what, name, repairs=(Without(name),))
    elif missing > _SELDOM:
        yield Finding("steps_missing", f"no sample at {100.0 * missing:.0f} % of the ticks", name)
    elif held:
        what = f"the same as before at {100.0 * np.mean(again):.0f} % of the ticks"
        yield Finding("steps_missing", what, name)
