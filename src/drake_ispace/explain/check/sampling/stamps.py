"""What time stamps alone show: units, epochs, clocks that do not overlap, gaps, jitter and bursts."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.fft import dct
from scipy.stats import chi2

from drake_ispace.explain.check.compare.links import FEWEST, RATE_S
from drake_ispace.explain.check.compare.motion import WINDOW_S
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.sampling.samples import LEAP, STUCK_S
from drake_ispace.explain.levels import CHANCE
from drake_ispace.faults.repair import Clock, CutOut, Dropped, Evened, span_text, time_text
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.files.units import in_si
from drake_ispace.robots.robot import COMMAND

#: Recorded unit of time -> seconds.
TIMES = {unit: in_si(unit) for unit in ("s", "ms", "us", "ns")}
_EPOCH_S = 86400.0  # a clock that starts a day later counts from some year
_SAMPLED = ("encoder", "imu", "torque")  # at a steady rate
_UNEVEN = 0.25  # a step that is uneven, as a share of the median


def stamp_findings(run: Recording) -> Iterator[Finding]:
    """Faults of the time stamps of a run, units first."""
    channels = run.channels
    found = list(_units(channels))
    yield from found
    if found:
        return
    for find in (_strays, _set_while_logged):
        found = list(find(channels))
        yield from found
        for repair in (repair for finding in found for repair in finding.repairs):
            channels = channels | {repair.channel: repair.repaired(channels[repair.channel])}
    yield from _starts(channels)
    for name in _SAMPLED:
        if name in channels and len(channels[name].t) > 20:
            yield from _steps(name, channels[name])


def _set_while_logged(channels: dict[str, Channel]) -> Iterator[Finding]:
    """Channels whose stamps leap from one epoch to another.

    Of channels that leap together, that with the finest steps tells by how much.
    """
    leaps, found, besides = [], [], []
    for name in channels:
        steps = np.diff(channels[name].t)
        for i in np.flatnonzero(steps > _EPOCH_S):
            leaps.append((float(np.median(steps)), name, int(i), float(steps[i] - np.median(steps))))
    set_back_s = dict.fromkeys(channels, 0.0)  # by earlier ones
    for usual, name, i, by_s in leaps:
        t = channels[name].t - set_back_s[name]
        together = [one for one in leaps if abs(one[3] - by_s) <= max(RATE_S, one[0] + usual)]
        by_s = min(together)[3]
        set_back_s[name] += by_s
        repair = Clock(name, 1.0, -by_s, float(t[i + 1]))
        if name in ("truth", "reference"):
            besides.append(repair)
            continue
        what = f"stamps leap by {by_s:.10g} s at {time_text(float(t[i]), 3)} s, as a clock was set or the log paused"
        found.append(Finding("epoch_stamps", what, name, float(t[i + 1]), float(t[-1]), repairs=(repair,)))
    for finding in found:
        yield replace(finding, repairs=finding.repairs + tuple(besides))
        besides = []


def _strays(channels: dict[str, Channel]) -> Iterator[Finding]:
    """A few samples of a channel that lie in another epoch than its others, and in no other channel's time."""
    logged = {name: channel.t for name, channel in channels.items() if name not in ("truth", "reference")}
    apart = {name: _few_apart(t) for name, t in logged.items()}
    spans = {name: np.delete(t, apart[name])[[0, -1]] for name, t in logged.items()}
    for name, at in apart.items():
        if not len(at):
            continue
        since, until = logged[name][at[[0, -1]]]
        if len(spans) > 1 and not any(since <= b and until >= a for a, b in spans.values()):
            others_s = min(a for a, _ in spans.values()), max(b for _, b in spans.values())
            what = f"{len(at)} sample{'s' * (len(at) > 1)} far from all others, which are {span_text(*others_s, 3)}"
            repair = Dropped(name, float(since), float(until))
            yield Finding("clocks_disjoint", what, name, float(since), float(until), repairs=(repair,))


def _few_apart(t: np.ndarray) -> np.ndarray:
    """Numbers of the samples, of t (n,), that lie in another epoch than the others; none if they can be compared."""
    steps, numbers = np.diff(t), np.arange(len(t))
    longest = int(np.argmax(steps)) if len(steps) else 0
    few = min(numbers[: longest + 1], numbers[longest + 1 :], key=len)
    is_far = len(steps) and steps[longest] > _EPOCH_S
    return few if is_far and len(few) < min(FEWEST, len(t) - len(few)) else numbers[:0]


def _units(channels: dict[str, Channel]) -> Iterator[Finding]:
    """Channels whose steps are those of another unit of time: too long to tell a motion by, as windows tell it.

    Where other channels have steps that are not, the unit is that in which a channel lasts as long as these. A command
    may be logged as seldom as it changes: its unit is another one if it then lasts as long as the others, to
    a factor of two.
    """
    measured = {
        name: channel for name, channel in channels.items()
        if name not in ("truth", "reference") and len(channel.t) > 2
    }
    steps = {name: float(np.median(np.diff(channel.t))) for name, channel in measured.items()}
    lasts = [float(np.ptp(measured[name].t)) for name, step in steps.items() if step <= WINDOW_S and name != COMMAND]
    for name, step in steps.items():
        if step <= WINDOW_S or (name == COMMAND and not lasts):
            continue
        possible = [unit for unit, seconds in TIMES.items() if step * seconds <= WINDOW_S]
        if lasts:
            off = np.abs(np.log(np.outer(list(TIMES.values()), np.ptp(measured[name].t) / np.array(lasts)))).min(axis=1)
            fits = name != COMMAND or off.min() < np.log(2.0)
            possible = [list(TIMES)[int(np.argmin(off))]] if fits else []
        if possible and possible[0] != "s":
            repairs = (Clock(name, TIMES[possible[0]], 0.0),)
            yield Finding("time_unit", f"stamps in {possible[0]}", name, repairs=repairs)


def _starts(channels: dict[str, Channel]) -> Iterator[Finding]:
    """Channels that do not overlap with the others in time."""
    spans = {n: (c.t[0], c.t[-1]) for n, c in channels.items() if n not in ("truth", "reference") and len(c.t) > 1}
    if len(spans) < 2:
        return
    overlaps = {
        name: sum(min(b, d) - max(a, c) > 0.0 for c, d in spans.values()) for name, (a, b) in spans.items()
    }
    most = max(overlaps.values())
    if most == len(spans):
        return
    kept = next((name for name in ("encoder", *spans) if overlaps.get(name) == most and most > 1), "encoder")
    kept = kept if kept in spans else next(iter(spans))
    start, end = spans[kept]
    for name, (a, b) in spans.items():
        if min(b, end) - max(a, start) <= 0.0:
            epoch = abs(a - start) > _EPOCH_S
            fault = "epoch_stamps" if epoch else "clocks_disjoint"
            what = f"is at {a:.10g} s to {b:.10g} s, the others from {start:.10g} s on"
            yield Finding(fault, what, name, repairs=(Clock(name, 1.0, float(start - a)),))


def _steps(name: str, channel: Channel) -> Iterator[Finding]:
    """Gaps, and steps that are uneven as a habit, though samples come at even ones all in all."""
    steps = np.diff(channel.t)
    usual = float(np.median(steps))
    longer = np.flatnonzero(steps > np.mean(steps))  # between samples that come at once
    lasts_s = channel.t[longer] - channel.t[np.append(0, longer[:-1] + 1)]
    at_once = np.median(lasts_s) < RATE_S  # a pause of the log has a motion before it
    if at_once and _mostly(LEAP * steps < np.mean(steps)) and not are_gaps(steps[longer]).any():
        yield Finding("bursts", "several samples come at once", name, repairs=(Evened(name),))
        return
    if _mostly(np.abs(steps - usual) > _UNEVEN * usual) and not _wander_off(steps):
        yield Finding("stamp_jitter", "steps are uneven", name, repairs=(Evened(name),))
        return
    for i in np.flatnonzero(are_gaps(steps)):
        since, until = float(channel.t[i]), float(channel.t[i + 1])
        repairs = (CutOut(since, until),) if until - since > STUCK_S else ()
        yield Finding("rows_missing", f"no samples for {until - since:.3g} s", name, since, until,
                      repairs=repairs)


def _wander_off(steps: np.ndarray) -> bool:
    """Whether steps (n,) wander off from even ones, as where rows are lost or a sensor has a pace of its own.

    Samples that were taken at even steps and stamped late come back to them, so that steps have no slow parts; of steps
    that have nothing to do with each other these are as large as all others, by chi-squared.
    """
    slow = dct(steps - np.mean(steps), norm="ortho")[1 : 1 + math.isqrt(len(steps))]
    return bool(np.sum(slow**2) >= chi2.ppf(CHANCE, len(slow)) * np.var(steps))


def are_gaps(steps: np.ndarray) -> np.ndarray:
    """(n,) which steps between samples [s] are too long to be steps of the channel."""
    return steps > max(2.0 * RATE_S, LEAP * float(np.median(steps)))


def _mostly(flags):
    """Whether they hold as often as not."""
    return 2 * np.sum(flags) >= len(flags)
