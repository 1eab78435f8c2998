"""How many times as large a command is as the wheels say, and what that tells of its scale.

Commands may be logged in percent of a largest speed, as shares of it or in counts of a motor's driver. No list holds
such scales. The ratio to the wheels' motion is then said as it is measured, as that of torques is. A drive that goes
less far than it is told looks the same, so that nothing is repaired by it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.check.compare.agreement import RELATED
from drake_ispace.explain.check.compare.links import FEWEST, LATENCY_S, Base, camera_link, held_integral, inside
from drake_ispace.explain.check.compare.motion import WINDOW_S
from drake_ispace.explain.check.compare.regression import MOST_SLACK, SLACK
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import COMMAND

#: Shares of what it is told that a drive may do: a weak or limited one little, none plainly more.
_LEAST_SHARE, _MOST_SHARE = 0.3, 1.0 + MOST_SLACK
_AFTER = range(-1, 4)  # windows after a motion is told, in which the wheels may do it
_ADVICE = (
    "log the command in m/s and rad/s, not in shares of a largest speed or the like: "
    "the ratio cannot tell a scale from a gain of the drive"
)


def ratios(runs: Sequence[Recording], bases: Sequence[Base | None]) -> list[tuple[float | None, float | None]]:
    """How many times as large as the wheels say vx, vy and wz of each command are; None: not known."""
    both = zip(runs, bases, strict=True)
    there = [(run, base) for run, base in both if base is not None and COMMAND in run.channels]
    return [(_ratio(run, base, (0, 1)), _ratio(run, base, (2,))) for run, base in there]


def doubted(runs: Sequence[Recording], bases: Sequence[Base | None]) -> list[tuple[float | None, float | None]]:
    """The ratios to the wheels, but 1 where the camera sees as much: two channels are not both wrong by one factor."""
    there = [i for i, run in enumerate(runs) if bases[i] is not None and COMMAND in run.channels]
    found = []
    for i, told in zip(there, ratios(runs, bases), strict=True):
        seen = _seen(runs[i], bases[i])
        found.append(tuple(1.0 if _is_seen(*both) else both[0] for both in zip(told, seen, strict=True)))
    return found


def _seen(run, base):
    """How many times as large as the wheels say the ways and the turns are that a camera sees; None: not known."""
    link = camera_link(run, base)
    kept = [] if link is None else inside(base, link.since_s, link.until_s)
    if np.sum(kept) < FEWEST:
        return None, None
    wheels, seen = link.predicted(link.since_s[kept], link.until_s[kept]), link.measured[kept]
    both = [np.sum(wheels[:, k] * seen[:, k]) / max(np.sum(wheels[:, k] ** 2), 1e-300) for k in map(list, link.groups)]
    return tuple(float(ratio) if ratio > 0.0 else None for ratio in both)


def _is_seen(told, seen):
    return told is not None and seen is not None and not is_unit(told) and is_unit(told / seen)


def _ratio(run, base, columns):
    """The ratio in some columns, however late the wheels follow; None where they follow too badly.

    Of wheels that follow late or slowly, the shares that they do in each of some windows afterwards add up.
    """
    command = run.channels[COMMAND]
    since = np.arange(base.encoder.t[0] + 2.0 * base.rate_s, base.encoder.t[-1] - 2.0 * base.rate_s, LATENCY_S)
    at = np.array([[since + (part - after) * WINDOW_S for part in (0, 1)] for after in _AFTER])
    kept = inside(base, since, since + WINDOW_S) & (at.min((0, 1)) >= command.t[0]) & (at.max((0, 1)) <= command.t[-1])
    if kept.sum() < 2 * FEWEST:
        return None
    wheels = base.moved(since[kept], since[kept] + WINDOW_S)
    told = np.stack([held_integral(command, *times) for times in at[:, :, kept]], axis=2)  # (n, 3, windows)
    power, left, share = np.zeros(3), np.zeros(3), np.zeros(3)
    for k in columns:
        of_each = np.linalg.lstsq(told[:, k], wheels[:, k], rcond=None)[0]
        left[k] = np.sum((wheels[:, k] - told[:, k] @ of_each) ** 2)
        power[k], share[k] = np.sum(wheels[:, k] ** 2), abs(of_each.sum())
    follows = left.sum() < RELATED * power.sum()
    return float(power.sum() / (power @ share)) if follows and power @ share > 0.0 else None


@dataclass(frozen=True)
class Scale:
    """What some columns of a command may be in: in words, and what a number in it must be multiplied by.

    advice: of a scale that is as measured, and no unit.
    """

    what: str
    factor: float
    advice: str = ""


def scales(measured: Iterable[float | None], given: str, units: Mapping[str, float]) -> list[Scale]:
    """All that some columns may be in, the unit that they should be in first.

    measured: of each run, as of `ratios`. given: the unit that they should be in. units: others, and their sizes in it;
    of these only what some run may be in. A ratio that no unit explains is a scale by itself.
    """
    measured = list(measured)
    known = [ratio for ratio in measured if ratio is not None]
    found = [Scale("", 1.0)] + [
        Scale(f"in {name}", size) for name, size in units.items()
        if len(known) < len(measured) or any(is_unit(ratio * size) for ratio in known)
    ]
    for ratio in sorted(known, key=lambda one: abs(np.log(one / np.median(known)))):  # what most runs have first
        explained = any(is_unit(ratio * scale.factor) for scale in found)
        if not explained and not _LEAST_SHARE <= 1.0 / ratio <= _MOST_SHARE:
            found.append(Scale(_said(ratio, {given: 1.0, **units}), 1.0 / ratio, _ADVICE))
    return found


def is_unit(ratio: float) -> bool:
    """Whether a command may be so many times as large as the wheels say, and that be hardly less probable than once."""
    return (1.0 / ratio - 1.0) ** 2 <= 2.0 * SLACK**2


def _said(ratio, units):
    """In words, a scale that is no unit, and the unit that it may be if the drive does less or more than it is told."""
    shares = {name: 1.0 / (ratio * size) for name, size in units.items()}
    nearest = min(shares, key=lambda name: abs(np.log(shares[name])))
    said = f"about {float(f'{ratio:.2g}'):g} times as large as the wheels say"
    if _LEAST_SHARE <= shares[nearest] <= 1.0 / _LEAST_SHARE:
        said += f" ({nearest} if the drive does {shares[nearest]:.0%} of it)"
    return said
