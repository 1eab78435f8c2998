"""What seems wrong of the rear wheels of a tricycle, whose angles were computed, may be wrong of its steering."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.library import FAULTS
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot_file import REAR_COMPUTED

_STEERING, _EXCHANGED = "steering", "wheels_swapped"
_ADVICE = "correct the sense of steer_front in the mapping and import again"


def of_steering(findings: Iterable[Finding], runs: Sequence[Recording]) -> list[Finding]:
    """The findings, those on rear wheels that nobody logged as what the steering does to them.

    Steering of the other sense makes such wheels change places. In another unit, or with another wheelbase, it makes
    the robot turn by a factor less or more than they say, as another track does.
    """
    return [_of_steering(one) if all(REAR_COMPUTED in runs[i].notes for i in one.runs) else one for one in findings]


def _of_steering(finding):
    if finding.fault == _EXCHANGED:
        return replace(finding, fault=_STEERING, what="it has the other sense", advice=_ADVICE)
    if finding.fault in FAULTS[_STEERING].same:
        return replace(finding, rivals=(_STEERING, *finding.rivals))
    return finding
