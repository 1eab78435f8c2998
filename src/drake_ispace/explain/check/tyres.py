"""A model that cannot turn, as its tyres hold it, of a robot that turns: it skids.

How far such a robot turns no model of rolling wheels says. The camera does.
"""

from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.check.compare.agreement import RELATED
from drake_ispace.explain.check.compare.links import FEWEST, Base, inside, link_of, moving
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Mixed
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import COMMAND

#: Channel -> what it says, in words; the surest first.
_SAYS = {
    "kinect": "the camera sees the robot turn", "imu": "the gyro says that the robot turns",
    COMMAND: "the robot is told to turn",
}
_LIST = "list the model's tyres in one line across the robot"


def turning_findings(runs: Sequence[Recording], bases: Sequence[Base | None]) -> list[Finding]:
    """What the first channel that turns as the wheels differ says of a model that cannot turn; a finding for each run.

    A camera tells by how much less the robot turns than wheels that do not skid would turn it.
    """
    having = [i for i, base in enumerate(bases) if base is not None and base.skids]
    for channel in _SAYS if having else ():
        times = [times for i in having if (times := _times(runs[i], bases[i], channel)) is not None]
        if times:
            return _findings(having, bases, channel, float(np.median(times)))
    return []


def _findings(having, bases, channel, times):
    what = f"its tyres hold every turn, and {_SAYS[channel]} where its wheels differ"
    if channel != "kinect":
        advice = f"{_LIST}, so far apart that turns agree, which a camera tells"
        return [Finding("tyres_hold", what, "model", runs=(i,), advice=advice) for i in having]
    apart = "as far apart as they stand" if f"{times:.2g}" == "1" else f"about {times:.2g} times as far apart"
    advice = f"{_LIST}, {apart}"
    return [
        Finding("tyres_hold", f"{what}, as if they stood in one line, {apart}", "model", runs=(i,),
                advice=advice, for_now=(_turned_less(bases[i], times),)) for i in having
    ]


def _turned_less(base, times):
    """What makes wheels turn the robot so many times less, and move it as far."""
    forward, inverse = base.geometry.forward, base.geometry.inverse
    wheels = np.eye(len(inverse)) + inverse @ np.diag([0.0, 0.0, 1.0 / times - 1.0]) @ forward
    return Mixed("encoder", base.encoder.columns, tuple(map(tuple, wheels.tolist())))


def _times(run, base, channel):
    """How many times as far as a channel says, the wheels turn the robot; None: they do not turn alike, or hardly turn.
    """
    link = link_of(run, base, channel)
    if link is None:
        return None
    kept = inside(base, link.since_s, link.until_s)
    wheels, said = link.predicted(link.since_s[kept], link.until_s[kept])[:, -1], link.measured[kept, -1]
    if kept.sum() < FEWEST or not all(moving(turns[:, None], link.noise[-1:]) for turns in (wheels, said)):
        return None
    alike = wheels @ said
    is_alike = alike > 0.0 and alike**2 > RELATED * (wheels @ wheels) * (said @ said)
    return float(np.linalg.norm(wheels) / np.linalg.norm(said)) if is_alike else None
