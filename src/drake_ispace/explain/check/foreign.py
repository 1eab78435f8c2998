"""Channels that say nothing of the wheels' motion: of another run, or of a robot of other dimensions."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.check.agreement import SAID, compared
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.links import FEWEST, Base, camera_link, inside, links
from drake_ispace.explain.check.motion import turned
from drake_ispace.explain.check.regression import scores
from drake_ispace.faults.repair import Without
from drake_ispace.files.recording import Recording

_FREE = 1.5  # loss of log likelihood for a free number


def foreign(runs: Sequence[Recording], bases: Sequence[Base | None]) -> list[Finding]:
    """Channels that do not move with the wheels, in any reading; the wheels themselves if no channel moves with them."""
    found = []
    for number, (run, base) in enumerate(zip(runs, bases, strict=True)):
        if base is None:
            continue
        relation = {name: _relation(link, base) for name, link in links(run, base).items()}
        strangers = [name for name, gain in relation.items() if gain is not None and gain < -SAID]
        friends = [name for name, gain in relation.items() if gain is not None and gain > SAID]
        if not strangers:
            continue
        free = _free_gain(run, base) if "kinect" in strangers else 0.0
        if free > SAID and not friends:
            found.append(Finding(
                "another_robot", "wheels and camera go together, but not by these dimensions", "", (number,), "model",
                drop_in_deviance=2.0 * free, rivals=("wheel_order", "gear"),
            ))
        elif friends or "kinect" in strangers:
            channels = strangers if friends else ["encoder"] if len(strangers) > 1 else strangers
            for name in channels:
                found.append(Finding(
                    "channel_of_another_run", "does not move with the robot", "", (number,), name,
                    drop_in_deviance=-2.0 * relation.get(name, min(relation[s] for s in strangers)),
                    rivals=("encoder",) if name == "kinect" and not friends else (), repairs=(Without(name),),
                ))
    return found


def _relation(link, base):
    """Log likelihood of a channel that moves with the wheels over one that does not; None: too little motion to tell."""
    if len(link.since_s) < FEWEST:
        return None
    matrices = [np.eye(link.measured.shape[1])]
    given = compared(link, base, matrices)
    if given is None:
        return None
    kept = inside(base, link.since_s, link.until_s)
    y = link.measured[kept][None]
    besides = None if link.besides is None else link.besides(link.since_s[kept], link.until_s[kept])
    unrelated = scores(np.zeros_like(y), y, link.groups, link.noise[None], besides)
    return float(given[0] - unrelated[0])


def _free_gain(run, base):
    """What wheels of any dimensions gain over no relation to the camera at all."""
    link = camera_link(run, base)
    kept = inside(base, link.since_s, link.until_s)
    if kept.sum() < 2 * FEWEST:
        return 0.0
    angles, y = turned(base.encoder, link.since_s[kept], link.until_s[kept]), link.measured[kept]
    # of every second window the dimensions, on the others the gain
    matrix = np.linalg.lstsq(angles[::2], y[::2], rcond=None)[0]
    x, y = (angles @ matrix)[1::2][None], y[1::2][None]
    noise = link.noise[None]
    gain = scores(x, y, link.groups, noise) - scores(np.zeros_like(x), y, link.groups, noise)
    return float(gain[0]) - _FREE


