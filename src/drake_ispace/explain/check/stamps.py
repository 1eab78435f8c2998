"""What time stamps alone show: units, epochs, clocks that do not overlap, gaps, jitter and bursts."""

from collections.abc import Iterator

import numpy as np

from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Clock, Evened
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.files.units import in_si

#: Recorded unit of time -> seconds.
TIMES = {unit: in_si(unit) for unit in ("ms", "us", "ns")}
_LONGEST_STEP_S = 1.0  # of a sensor of a robot
_LONGEST_STEADY_S = 0.25  # of wheels, torque and IMU
_UNIT_RATIO = 1.5  # durations that agree in the right unit
_EPOCH_S = 1e6  # a clock that starts later counts from some year, not from the start of a run
_SAMPLED = ("encoder", "imu", "torque")  # at a steady rate
_GAP_S, _GAP_STEPS = 0.1, 10.0
_UNEVEN, _OFTEN = 0.25, 0.2  # a step that is uneven, as a share of the median; a share of steps that is a habit
_AT_ONCE = 0.1  # a step of a burst, as a share of the median


def stamp_findings(run: Recording, number: int) -> Iterator[Finding]:
    """Faults of the time stamps of a run, units first."""
    channels = run.channels
    found = list(_units(channels, number))
    yield from found
    if not found:
        yield from _starts(channels, number)
        for name in _SAMPLED:
            if name in channels and len(channels[name].t) > 20:
                yield from _steps(name, channels[name], number)


def _units(channels: dict[str, Channel], number: int) -> Iterator[Finding]:
    """Channels whose steps are those of another unit of time, unless they last as long as one whose steps are not."""
    measured = {
        name: channel for name, channel in channels.items()
        if name not in ("truth", "reference", "command") and len(channel.t) > 2
    }
    steps = {name: float(np.median(np.diff(channel.t))) for name, channel in measured.items()}
    longest = {name: _LONGEST_STEADY_S if name in _SAMPLED else _LONGEST_STEP_S for name in measured}
    lasts = [float(np.ptp(measured[name].t)) for name, step in steps.items() if step <= longest[name]]
    for name, step in steps.items():
        own = float(np.ptp(measured[name].t))
        if step <= longest[name] or any(1.0 / _UNIT_RATIO < own / other < _UNIT_RATIO for other in lasts):
            continue
        for unit, seconds in TIMES.items():
            if step * seconds <= _LONGEST_STEP_S:
                repairs = (Clock(name, seconds, 0.0),)
                yield Finding("time_unit", f"stamps in {unit}", "", (number,), name, repairs=repairs)
                break


def _starts(channels: dict[str, Channel], number: int) -> Iterator[Finding]:
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
            yield Finding(fault, what, "", (number,), name, repairs=(Clock(name, 1.0, float(start - a)),))


def _steps(name: str, channel: Channel, number: int) -> Iterator[Finding]:
    """Gaps, and steps that are uneven as a habit."""
    steps = np.diff(channel.t)
    usual = float(np.median(steps))
    if float(np.mean(steps)) > 0.0 and np.mean(steps < _AT_ONCE * np.mean(steps)) > _OFTEN:
        yield Finding("bursts", "several samples come at once", "", (number,), name, repairs=(Evened(name),))
        return
    if np.mean(np.abs(steps - usual) > _UNEVEN * usual) > _OFTEN:
        yield Finding("stamp_jitter", "steps are uneven", "", (number,), name, repairs=(Evened(name),))
        return
    for i in np.flatnonzero(steps > max(_GAP_S, _GAP_STEPS * usual)):
        yield Finding("rows_missing", f"no samples for {steps[i]:.3g} s", "", (number,), name, float(channel.t[i]),
                      float(channel.t[i + 1]))
