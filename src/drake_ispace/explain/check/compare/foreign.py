"""Channels that say nothing of the wheels' motion: of another run, or of a robot of other dimensions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from drake_ispace.explain.check.compare.agreement import RELATED, SAID, following
from drake_ispace.explain.check.compare.clocks.paths import OFFSET
from drake_ispace.explain.check.compare.links import (
    FEWEST,
    LATENCY_S,
    Base,
    Link,
    camera_link,
    inside,
    link_of,
    links,
    moving,
)
from drake_ispace.explain.check.compare.motion import turned
from drake_ispace.explain.check.compare.regression import MOST_SLACK, SLACK, most, residuals, scores
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.runs import name_of
from drake_ispace.faults.repair import Without
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import COMMAND, TORQUE

Stretches = Sequence[tuple[float, float]]
GOES_WITH = 2.0 * RELATED  # share, as of `following`, above which a channel is told to go with these wheels
_OF_NOBODY = "does not move with the robot"
#: Channel -> what a channel may be besides that moves with the wheels in no run.
_WHOLE = {
    "encoder": ("wheels_swapped", "wheel_sign", "counts_per_turn", OFFSET),
    "imu": ("imu_axes", "wheels_swapped", "wrong_unit", OFFSET),
    TORQUE: ("torque_sign", "torques_swapped", "wrong_unit", OFFSET),
    COMMAND: ("command_sign", "command_axes_swapped", "command_in_room_frame", OFFSET),
    "kinect": ("camera_axis_mirrored", "heading_sign", "wheels_swapped", OFFSET),
}


@dataclass(frozen=True)
class _Relation:
    """How well a channel follows the wheels: share, as `following`, and the log likelihood over no relation at all.

    varies_alike: whether it is a command whose changes the wheels make.
    """

    share: float
    gain: float
    varies_alike: bool = False


def _related(related, unrelated, exact, varies_alike=False):
    """The _Relation of one with these logarithms of likelihood; None where nobody can say."""
    share = following(related, unrelated, exact)
    return None if share is None else _Relation(share, related - unrelated, varies_alike)


def _varies_alike(x, y):
    """Whether more of the variance of a command y (n, d) is the wheels' motion x than of one that is related at all.

    Up to a factor that physics allows. Two motions that go on at their means are not alike for that.
    """
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    factor = np.clip(np.sum(x * y) / max(np.sum(x**2), np.finfo(float).tiny), 1.0 - MOST_SLACK, 1.0 + MOST_SLACK)
    return bool(np.sum((y - factor * x) ** 2) < (1.0 - RELATED) * np.sum(y**2))


def foreign(
    runs: Sequence[Recording], bases: Sequence[Base | None], spoilt: Sequence[Stretches], apart: Sequence[Stretches],
) -> list[Finding]:
    """Channels that do not move with the wheels in any reading; the wheels themselves if none moves with them.

    Where camera and wheels go together by other dimensions than the model's, the model is wrong. Of these only a gyro
    can say otherwise: a command is carried out by the model's own, and torques are compared for their direction.

    spoilt: stretches [s] of each run at which something else is at fault. apart: in which wheels and camera tell of
        different motions: a camera that follows the wheels but there is no other run's, unless it follows these, too.
    """
    found = []
    for number, (run, base) in enumerate(zip(runs, bases, strict=True)):
        if base is None:
            continue
        linked = links(run, base)
        relation = {name: _relation(link, base, spoilt[number]) for name, link in linked.items()}
        relation = {name: one for name, one in relation.items() if one is not None}
        whose = cache(partial(owner, runs, bases, number))
        strangers = [
            name for name, link in linked.items()
            if _is_stranger(link, relation.get(name)) or _is_of_another(name, relation.get(name), whose)
        ]
        if "kinect" in strangers and apart[number] and not (whose("kinect") or whose("encoder")):
            beside = _relation(linked["kinect"], base, [*spoilt[number], *apart[number]])
            if beside is not None and not _is_stranger(linked["kinect"], beside):
                strangers.remove("kinect")
                relation["kinect"] = beside
        friends = [name for name, one in relation.items() if one.share > RELATED]
        if not strangers:
            continue
        free = _free_gain(run, base) if "kinect" in strangers and whose("kinect") is None else None
        if free is not None and free.share > GOES_WITH and "imu" not in friends:
            found.append(another_robot((number,), 2.0 * free.gain, ("wheel_order", "gear")))
            continue
        doubted = {*strangers, *(name for name, one in relation.items() if one.gain < -SAID)}
        # without a friend it is the stranger if nothing else is doubted, and the wheels are not another run's
        is_it = friends or (len(doubted) == 1 and (whose("encoder") is None or any(map(whose, strangers))))
        for name in strangers if is_it else ["encoder"]:
            against = sum(-one.gain for other, one in relation.items() if name in (other, "encoder"))
            found.append(Finding(
                "channel_of_another_run", whose(name) or _OF_NOBODY, name, runs=(number,),
                drop_in_deviance=2.0 * max(against, 0.0), rivals=() if friends else ("robot_lifted",),
                repairs=(Without(name),),
            ))
    return [_if_in_most(finding, found, runs) for finding in found]


def _if_in_most(finding, found, runs):
    """A finding with other mistakes as rivals if most runs have it: no logger takes all of them from elsewhere."""
    accused = [f for f in found if f.fault == finding.fault and f.what == finding.what == _OF_NOBODY]
    same = {f.runs for f in accused if f.channel == finding.channel}
    having = sum(finding.channel in run.channels for run in runs)
    if finding not in accused or len(same) < 2 or 2 * len(same) <= having:
        return finding
    return replace(finding, rivals=(*finding.rivals, *_WHOLE.get(finding.channel, ())))


def another_robot(runs: tuple[int, ...], drop_in_deviance: float, rivals: tuple[str, ...], advice: str = "") -> Finding:
    """The finding that the wheels and the camera of these runs are of another robot; arguments as of Finding."""
    return Finding(
        "another_robot", "wheels and camera go together, but not by these dimensions", "model", runs=runs,
        drop_in_deviance=drop_in_deviance, rivals=rivals, advice=advice,
    )


def _is_stranger(link, relation):
    """Whether a channel moves in another way than the wheels.

    Friction, weight or an offset may hide all but the camera's motion, but turn none against the wheels. What is
    compared beside motions of any share, such as a torque, must go against them clearly. A command that mostly says to
    go straight on is no stranger to wheels that wander a little, as long as both turn together where it says to turn.

    relation: None: too little motion to tell.
    """
    if relation is None:
        return False
    if link.channel == "kinect":
        return relation.share < RELATED
    if link.any_share:
        return relation.share < -RELATED
    return relation.gain < -SAID and not relation.varies_alike


def _is_of_another(name, relation, whose):
    """Whether a torque or an IMU hardly follows the wheels of its own run, and clearly those of another one.

    A command may do so by itself, where one run's wheels carry it out better than another's. relation: as of
    `_is_stranger`. whose: `owner` of a channel of this run.
    """
    follows = relation is not None and relation.share >= RELATED
    return name in (TORQUE, "imu") and not follows and whose(name) is not None


def owner(runs: Sequence[Recording], bases: Sequence[Base | None], number: int, name: str) -> str | None:
    """In words: with which other run a channel moves, put there in the place of that run's own; None: with none."""
    for other, base in enumerate(bases):
        if other == number or base is None:
            continue
        if name == "encoder":
            seen, run, wheels = "kinect", runs[other], bases[number]
        else:
            seen, wheels = name, base
            run = replace(runs[other], channels={**runs[other].channels, name: runs[number].channels[name]})
        link = link_of(run, wheels, seen)
        found = None if link is None else _relation(link, wheels)
        if found is not None and found.share > GOES_WITH:
            return f"moves with the {'camera' if name == 'encoder' else 'wheels'} of {name_of(runs[other], other)}"
    return None


def follows(link: Link, base: Base, lag_s: float = 0.0) -> float | None:
    """How well a channel follows the wheels, as `following`, if its clock is set by lag_s; None: nobody can say."""
    moved = replace(link, since_s=link.since_s + lag_s, until_s=link.until_s + lag_s)
    found = _relation(moved, base)
    return None if found is None else found.share


def _relation(link, base, spoilt=()):
    """How well a channel follows the wheels at the best of the usual lags, but for spoilt stretches.

    None: too little motion to tell. Of a torque, which may be early or late, it must be enough without a lag.
    """
    high = link.usual_s[1]
    lags = np.linspace(0.0, high, 4) if high > LATENCY_S else [0.0]
    if link.channel == TORQUE:
        lags = base.lags_s if _at_lag(link, base, 0.0, spoilt) is not None else []
    found = [one for one in (_at_lag(link, base, lag, spoilt) for lag in lags) if one is not None]
    return max(found, key=lambda one: (one.varies_alike, one.share), default=None)


def _at_lag(link, base, lag_s, spoilt):
    """How well a channel follows the wheels at one lag; of places and turns that which follows worse, if it moves.

    Of wheels that differ a little, a share of the way looks like a turn.
    """
    kept = inside(base, link.since_s, link.until_s, lag_s) & link.outside(spoilt, lag_s)
    if kept.sum() < FEWEST:
        return None
    since, until = link.since_s[kept] + lag_s, link.until_s[kept] + lag_s
    predicted, besides = link.predicted(since, until), None if link.besides is None else link.besides(since, until)
    found = []
    for group in map(list, link.groups):
        x, y, noise = predicted[:, group], link.measured[kept][:, group], link.noise[group]
        z, slack = None if besides is None else besides[:, group], link.slack
        if link.channel == "kinect":
            others = [j for j in range(len(link.noise)) if j not in group]
            share = slack.marker if others == [2] else SLACK
            z, slack = np.stack([predicted[:, others]] * len(group), axis=1), replace(slack, besides=share)
            z = np.stack([z, 0.0 * z])  # a marker that goes along as the wheels turn the robot is related to them
        # what goes on besides, such as the steady push into a circle, says nothing of whose motion it is
        own = [residuals(0.0 * x, motion, z) for motion in (x, y)] if link.any_share else (x, y)
        if all(moving(motion, noise) for motion in own):
            both, every = (np.stack([x, 0.0 * x]), y[None]), (tuple(range(len(group))),)
            given, unrelated = map(float, scores(*both, every, np.stack([noise, noise]), z, slack))
            exact = float(most(y[None], every, noise[None])[0])
            varies_alike = link.channel == COMMAND and _varies_alike(x, y)
            if link.channel == "kinect":
                opposite = float(scores(-x[None], y[None], every, noise[None], z[:1], slack)[0])
                if opposite - given > SAID:  # a share of the way may stand for a steady turn of the other sense
                    given = unrelated - max(opposite - unrelated, 0.0)
            found.append(_related(given, unrelated, exact, varies_alike))
    return min((one for one in found if one is not None), key=lambda one: (one.varies_alike, one.share), default=None)


def _free_gain(run, base):
    """How well the camera follows wheels of any dimensions; None: too little motion to tell."""
    link = camera_link(run, base)
    kept = inside(base, link.since_s, link.until_s)
    if kept.sum() < 2 * FEWEST:
        return None
    angles, y = turned(base.encoder, link.since_s[kept], link.until_s[kept]), link.measured[kept]
    # of every second window the dimensions, on the others the gain
    matrix = np.linalg.lstsq(angles[::2], y[::2], rcond=None)[0]
    x, y = (angles @ matrix)[1::2][None], y[1::2][None]
    noise = link.noise[None]
    free, unrelated = (scores(motion, y, link.groups, noise, slack=link.slack)[0] for motion in (x, 0.0 * x))
    return _related(float(free), float(unrelated), float(most(y, link.groups, noise)[0]))
