"""Is a commanded velocity held until the next sample, or a setpoint that moves on in between?

Wheels can only lag behind a command that is held. Where they lead it, the log shows some instants of something else.
"""

from collections.abc import Mapping

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.agreement import SAID
from drake_ispace.explain.check.compare.command.drive import Drive, best_following
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Interpolated
from drake_ispace.robots.robot import COMMAND

_NEAR = 0.25  # steps of the command: nearer to its sample than to half-way to the next


def setpoint_findings(drives: Mapping[int, Drive]) -> list[Finding]:
    """The finding that all runs together log a setpoint that moves on between its samples; or none.

    drives: number of a run -> its command and wheels.
    """
    moving = {i: drive for i, drive in drives.items() if drive.ramps and drive.step_s >= 2.0 * TICK_S}
    if not moving:
        return []
    step_s = float(np.median([drive.step_s for drive in moving.values()]))
    held_rates = [(drive, drive.held()) for drive in moving.values()]
    rates_between = [(drive, _between(drive)) for drive in moving.values()]
    held, between = best_following(held_rates, step_s, 0.0), best_following(rates_between, step_s, -_NEAR)
    score = between.score_over(held)
    if score < SAID or max(held.late_s, between.late_s) > _NEAR * step_s:
        return []
    score = min(score, between.score_over(best_following(rates_between, step_s, _NEAR)))
    earlier = best_following(rates_between, step_s, -2.0)
    if score < SAID or earlier.score_over(between) >= SAID:  # the latter: logged late, too
        return []
    return [Finding(
        "command_sampled", "the wheels lead what is held", COMMAND, runs=tuple(moving), drop_in_deviance=2.0 * score,
        repairs=(Interpolated(COMMAND, TICK_S),),
    )]


def _between(drive):
    """(k, n) commanded rates [rad/s] of the wheels along a smooth curve through the samples."""
    curve = Interpolated(COMMAND, TICK_S).repaired(drive.command)
    return curve.values @ drive.geometry.inverse.T
