"""Whose clock is off: that of a channel, or the wheels' own, by which all others are measured?

Two channels alone cannot tell. A third one can: either it goes by the wheels' clock, or by that of the channel that is
off against them. A clock that jumps ahead leaves out stamps, and they tell whose it was.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from drake_ispace.explain.check.compare.agreement import SAID
from drake_ispace.explain.check.compare.clocks.paths import LAGS_S, OFFSET, Path, least
from drake_ispace.explain.check.compare.clocks.trial import Links, trials_of
from drake_ispace.explain.check.compare.links import LATENCY_S, RATE_S, moves
from drake_ispace.explain.check.compare.motion import WINDOW_S
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Clock, time_text
from drake_ispace.robots.robot import COMMAND, TORQUE

LinksOf = Callable[[str], Links]  # gives those of a channel

_DRIFT, _JUMP = "clock_drift", "clock_jump"
SENSORS = ("kinect", "imu", TORQUE)
OTHERS = (*SENSORS, COMMAND)


def encoder_clock(found: Sequence[Finding], links_of: LinksOf) -> Iterator[Finding]:
    """The mistakes of the wheels' own clock; found: those of the clocks of the other channels."""
    off = [finding for finding in found if finding.fault == OFFSET]
    for runs in dict.fromkeys(finding.runs for finding in off):
        there = [finding for finding in off if finding.runs == runs]
        are_some = any(i not in runs for name in OTHERS for i, _, _ in links_of(name))
        yield from (_off_in_some if are_some else _off)(there, links_of)
    yield from _drifting([finding for finding in found if finding.fault == _DRIFT], links_of)
    yield from _jumping([finding for finding in found if finding.fault == _JUMP], links_of)


def told_apart(found: Sequence[Finding], links_of: LinksOf) -> list[Finding]:
    """Findings of a channel's clock, with the encoder's as a rival where no other channel goes by that of the wheels.

    found: of one channel. links_of: of those whose clock is not known to be off, else no links. Of a clock that jumps
    the stamps tell.
    """
    rival_of = {}
    for group in _alike([finding for finding in found if finding.fault in (OFFSET, _DRIFT)]):
        evidence = _evidence(group, links_of)
        if not any(against >= SAID for _, against in evidence.values()):
            rival_of |= {id(finding): f"{finding.fault} of encoder" for finding in group}
    return [
        replace(finding, rivals=(rival_of[id(finding)], *finding.rivals)) if id(finding) in rival_of else finding
        for finding in found
    ]


def _off(off, links_of):
    """The clock of the wheels where two sensors or more are off against it by the same in the same runs.

    Where only one sensor tells the time, the command counts as another one, which a drive follows later and never
    earlier: by as much as the sensor is early, or it is late itself.
    """
    sensors = [finding for finding in off if finding.channel != COMMAND]
    offsets = [finding.repairs[0].offset_s for finding in sensors]
    if not sensors or not max(offsets) - min(offsets) < LATENCY_S:
        return
    offset_s, against = sum(offsets) / len(offsets), ["all others"]
    if len(sensors) == 1:
        runs, against = sensors[0].runs, [sensors[0].channel, COMMAND]
        telling = [name for name in SENSORS if any(moves(link) for _, link, _ in links_of(name))]
        driven = trials_of(_in_runs(links_of(COMMAND), runs))
        if len(telling) > 1 or not driven:
            return
        lost = np.sum([trial.total for trial in driven], axis=0)
        leads = lost[LAGS_S > -RATE_S - 1e-9].min() - lost.min() >= SAID  # which no drive does
        followed = [finding.repairs[0].offset_s for finding in off if finding.channel == COMMAND]
        if offset_s < 0.0 and not leads and not followed:
            return
        followed_s = followed[0] if followed else float(LAGS_S[np.argmin(lost)])
        if not offset_s - RATE_S <= followed_s < offset_s + LATENCY_S:
            return
    drop = sum(finding.drop_in_deviance for finding in sensors)
    yield Finding(
        OFFSET, _offset(offset_s, against), "encoder", runs=sensors[0].runs, drop_in_deviance=drop,
        repairs=(Clock("encoder", 1.0, -offset_s),),
    )


def _off_in_some(off, links_of):
    """The clock of the wheels where a sensor is off against it in some runs, and another channel by the same.

    By how much that one is late else, the other runs tell. A drive may lag otherwise in these: where the command alone
    agrees, the sensor's clock is a rival.
    """
    for finding in off:
        offset_s = finding.repairs[0].offset_s
        agree = _agree(_evidence([finding], links_of)) if finding.channel != COMMAND else []
        if agree:
            rivals = (f"{OFFSET} of {finding.channel}",) if agree == [COMMAND] else ()
            yield replace(
                finding, what=_offset(offset_s, [finding.channel, *agree]), channel="encoder", rivals=rivals,
                interval=None, harmless=False, repairs=(Clock("encoder", 1.0, -offset_s),),
            )
            return


def _drifting(drifts, links_of):
    """The clock of the wheels where a sensor's drifts against it, another channel's by the same, and none's does not.

    Two clocks are set when a recording begins: what is left there of the sensor's is no more than a latency, or is
    taken off as well.
    """
    told = set()
    for group in _alike([finding for finding in drifts if finding.channel != COMMAND]):
        group = [finding for finding in group if not told & set(finding.runs)]
        agree = _agree(_evidence(group, links_of)) if group else []
        if not agree:
            continue
        channel = group[0].channel
        link_of = {i: (link, base) for i, link, base in links_of(channel)}
        for finding in group:
            (i,), rate = finding.runs, finding.repairs[0].rate
            told.add(i)
            link, base = link_of[i]
            begins_s = float(base.encoder.t[0])
            if not link.is_usual(finding.repairs[0].moved(np.array(begins_s)) - begins_s):
                begins_s = finding.repairs[0].offset_s / (1.0 - rate)  # where both show the same time
            what = f"clock {100 * abs(rate - 1.0):.2g} % {'fast' if rate > 1.0 else 'slow'} against "
            yield replace(
                finding, what=what + " and ".join([channel, *agree]), channel="encoder", rivals=(),
                repairs=(Clock("encoder", 1.0 / rate, begins_s * (1.0 - 1.0 / rate)),),
            )


def _jumping(jumps, links_of):
    """The clock of the wheels where a channel's jumps back against it just where its stamps leave out as much."""
    told = set()
    for finding in sorted(jumps, key=lambda one: OTHERS.index(one.channel)):
        (i,), clock = finding.runs, finding.repairs[0]
        for _, link, base in _in_runs(links_of(finding.channel), finding.runs):
            t = base.encoder.t
            left_out = np.diff(t) - np.median(np.diff(t))
            near = (t[:-1] <= clock.since_s + WINDOW_S) & (t[1:] >= clock.since_s - WINDOW_S)
            fits = np.flatnonzero(near & (np.abs(left_out - clock.offset_s) <= link.differ_s + 1e-9))
            if i in told or not len(fits) or clock.offset_s <= link.differ_s:
                continue
            told.add(i)
            at = int(fits[np.argmin(np.abs(left_out[fits] - clock.offset_s))])
            since_s, later_s = float(t[at + 1]), float(left_out[at])
            yield replace(
                finding, what=f"clock jumps by {later_s:.3g} s at {time_text(float(t[at]), 3)} s", channel="encoder",
                from_s=float(t[at]), to_s=float(t[-1]), rivals=(), repairs=(Clock("encoder", 1.0, -later_s, since_s),),
            )


def _offset(offset_s, channels):
    """In words: by how much [s] the encoder's clock is off against that of other channels."""
    return f"clock {abs(offset_s):.3g} s {'early' if offset_s < 0 else 'late'} against {' and '.join(channels)}"


def _alike(findings):
    """Findings in groups that are of one clock: of the same channel, mistake and rate."""
    groups: dict[tuple, list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.channel, finding.fault, finding.repairs[0].rate), []).append(finding)
    return list(groups.values())


def _agree(evidence):
    """The channels that go by the clock that is off against the wheels'; none if one goes by that of the wheels."""
    if any(against >= SAID for _, against in evidence.values()):
        return []
    return [name for name, (gain, _) in evidence.items() if gain >= SAID]


def _evidence(group, links_of):
    """Channel -> log likelihoods that it goes by the clock of a group of findings, and that by that of the wheels."""
    path_of = {
        i: Path(finding.repairs[0].offset_s, finding.repairs[0].rate - 1.0) for finding in group for i in finding.runs
    }
    found = {}
    for name in OTHERS:
        if name != group[0].channel:
            trials = trials_of(_in_runs(links_of(name), path_of))
            if group[0].fault == _DRIFT:
                pairs = [_of_drift(trial, path_of[trial.number]) for trial in trials]
            else:
                others = trials_of([one for one in links_of(name) if one[0] not in path_of])
                pairs = [_of_offset(trial, path_of[trial.number].lag_s, others) for trial in trials]
            found[name] = tuple(np.sum(pairs, axis=0)) if pairs else (0.0, 0.0)
    return found


def _of_drift(trial, path):
    """The log likelihoods that a channel goes by a clock that drifts, and that by that of the wheels.

    It may be late by as much by either clock. trial: of the channel in one run. path: of the clock against the wheels'.
    """
    late = [replace(path, lag_s=path.lag_s + float(lag)) for lag in LAGS_S[trial.usual]]
    best = least(late, trial.unlikely)
    gain = trial.gain(best)
    return gain, -gain - trial.loss_of(best)  # it is that rate or none


def _of_offset(trial, off_s, others):
    """The log likelihoods that a channel goes by a clock that is off by `off_s` [s], and that by that of the wheels.

    By either clock it is as late as in other runs, if there are any, or else by what is usual. A drive only follows.

    trial: of the channel in one run. others: of the same channel in runs in which no clock is off.
    """
    if others:
        near = Path(float(LAGS_S[np.argmin(np.sum([other.total for other in others], axis=0))])).shifted()
        usual = least(near, lambda paths: np.sum([other.of_same_windows(paths) for other in others], axis=0))
        lags_s = np.array([usual.lag_s])
    else:
        earliest_s = RATE_S if trial.link.channel == COMMAND else LATENCY_S
        lags_s = LAGS_S[(LAGS_S > -earliest_s - 1e-9) & (LAGS_S < LATENCY_S + 1e-9)]
    paths = [Path(float(lag)) for lag in (*lags_s, *(lags_s + off_s))]
    by_wheels, by_other = np.split(trial.of_same_windows(paths), 2)
    against = float(by_other.min() - by_wheels.min())
    return -against, against


def _in_runs(links, runs):
    """Those links that are of these runs."""
    return [one for one in links if one[0] in runs]
