"""What the samples of one channel show by themselves: counters that wrap, rows that repeat, values that clip."""

from collections.abc import Iterator
from functools import cache
from itertools import combinations

import numpy as np

from drake_ispace.explain.check.compare.links import RATE_S
from drake_ispace.explain.check.compare.motion import WINDOW_S, step_of
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.levels import CERTAIN, CHANCE
from drake_ispace.faults.repair import CutOut, Dropped, Mirrored, Unwrapped, Without, time_text
from drake_ispace.files.recording import Channel, Recording

STUCK_S = WINDOW_S  # rows that repeat for longer have stopped
_BLOCK = 20  # rows that come twice
LEAP = 8.0  # of which no motion is the cause: a step in steps that are otherwise the largest
_STEPS = 40  # of a range, below which they are coarse
_FINE = 0.01  # m or rad: a camera's steps below it are fine however little the robot moves
_NOISY = ("imu", "torque")  # never the same twice


def wrap_findings(run: Recording, counts_per_turn: float) -> Iterator[Finding]:
    """A counter of the wheels that starts anew: steps of one height against the motion, far above all others.

    Of rows that come a second time, the step back to them is none.
    """
    if "encoder" not in run.channels:
        return
    channel, heights, columns, off = run.channels["encoder"], [], [], 0.0
    back_s = cache(lambda: [finding.from_s for finding in _repeated("encoder", channel)])
    for name in channel.columns:
        steps = np.diff(channel.column(name))
        size = np.abs(steps)
        if len(size) < 2 * _BLOCK or not (size > 0.0).any():
            continue
        # of steps that are far enough below a turn to be told from it, no more than that share starts anew
        usual = max(np.quantile(size, 1.0 - 1.0 / LEAP), np.median(size[size > 0.0]))
        far = size > LEAP * usual
        if far.any() and np.ptp(channel.column(name)) > size[far].max():  # a counter never leaves its turn
            far &= ~np.isin(channel.t[1:], back_s())
        again = far[1:] & far[:-1] & (steps[1:] * steps[:-1] > 0.0)
        if not far.any() or again.any():  # no counter starts anew twice in a row
            continue
        motion = np.convolve(np.where(far, 0.0, steps), np.ones(2 * _BLOCK + 1) / (2 * _BLOCK + 1), "same")[far]
        exact = np.abs(steps[far] - motion)
        alike = np.abs(exact - np.median(exact)) < usual  # which is how far a wheel moves besides
        # a single leap may be any, but no counter leaves the range after which it starts anew
        if np.mean(alike) <= 0.5 or (len(exact) == 1 and np.ptp(channel.column(name)) > exact[0] + usual):
            continue
        along = (np.sign(steps[far]) * motion)[alike]
        # at rest near the end of a turn a wheel starts anew either way: the faster it turns, the more its sense counts
        if np.mean(along > 0.0) < 0.5 and np.maximum(along, 0.0).sum() < 0.2 * np.abs(along).sum():
            heights.append(exact[alike])
            columns.append(name)
            off = max(off, usual)
    if not heights:
        return
    turn = _known_turn(float(np.median(np.concatenate(heights))), off, counts_per_turn, max(map(len, heights)))
    if turn is not None:
        known, fault = turn
        rival = "counter_wrap" if fault == "angle_wrap" else "angle_wrap"
        yield Finding(fault, f"starts anew after {known:.6g}", "encoder", rivals=(rival,),
                      repairs=(Unwrapped("encoder", tuple(columns), known),))


def sample_findings(run: Recording, steps: bool = False) -> Iterator[Finding]:
    """Faults of the samples of a run that need no other channel; steps: whether a torque may be constant."""
    for name, channel in run.channels.items():
        if name in ("truth", "reference", "command") or len(channel.t) < 2 * _BLOCK:
            continue
        found = list(_clipped(name, channel)) if name in _NOISY else []
        if name in _NOISY and not found:
            found = list(_stuck(run, name, steps and name == "torque"))
        if name == "encoder" and not found:
            found = list(_stopped(channel))
        if not found:
            found = list(_repeated(name, channel))
        if name not in _NOISY and not found:
            found = list(_reversed(name, channel))
        if name == "encoder" and not found:
            found = list(_set_anew(channel))
        yield from found


def _known_turn(height, off, counts_per_turn, times):
    """The turn after which counters start anew that is nearest to a height, no more than `off` away, and its fault.

    Where none is near, the height itself, if a wheel has it more than once.
    """
    turns = {2.0 * np.pi: "angle_wrap", 360.0: "angle_wrap", 1.0: "angle_wrap", 4.0 * np.pi: "angle_wrap"}
    units = [1.0, 2.0 * np.pi / counts_per_turn, 360.0 / counts_per_turn] if counts_per_turn > 0 else [1.0]
    turns |= {2.0**bits * unit: "counter_wrap" for unit in units for bits in range(4, 33)}
    if counts_per_turn > 0:
        turns[counts_per_turn] = "angle_wrap"
    nearest = min(turns, key=lambda turn: abs(turn - height))
    if abs(nearest - height) <= off:
        return nearest, turns[nearest]
    return (height, "counter_wrap") if times > 1 else None


def _repeated(name: str, channel: Channel) -> Iterator[Finding]:
    """A block of rows that comes a second time.

    A wheel that turns slowly between coarse counts repeats itself, but it does not jump from its past to what it
    repeats, or from there to what follows, much farther than it ever turns from row to row. A torque that is commanded
    periodically repeats itself until the run ends.
    """
    values = np.ascontiguousarray(channel.values[:, :3] if name == "kinect" else channel.values)
    steps = np.abs(np.diff(values, axis=0))
    _, codes = np.unique(values, axis=0, return_inverse=True)
    codes = codes.ravel()
    windows = np.lib.stride_tricks.sliding_window_view(codes, _BLOCK)
    changes = np.diff(windows, axis=1) != 0
    lively = changes.sum(axis=1) > (~changes).sum(axis=1)
    first: dict[bytes, int] = {}
    far, end = 2.0 * np.quantile(steps, 0.99), 0
    for i in np.flatnonzero(lively).tolist():
        if i < end:  # within a repetition that was looked at
            continue
        j = first.setdefault(windows[i].tobytes(), i)
        if i - j >= _BLOCK:
            end = i + _BLOCK
            while end < len(codes) and codes[end] == codes[end - i + j]:
                end += 1
            if name != "imu":
                if end == len(codes):
                    return
                ends, within = steps[[i - 1, end - 1]], steps[i : end - 1].max(axis=0)
                if np.all(ends <= (far if name == "encoder" else within)):
                    continue
            yield Finding("rows_duplicated", f"the rows from {time_text(channel.t[j], 3)} s on come again", name,
                          float(channel.t[i]), float(channel.t[end - 1]),
                          repairs=(Dropped(name, float(channel.t[i]), float(channel.t[end - 1])),))
            return


def _reversed(name: str, channel: Channel) -> Iterator[Finding]:
    """A stretch in the opposite order: the two largest steps vanish together when it is turned round."""
    values = channel.values[:, :3] if name == "kinect" else channel.values
    if name == "kinect":
        values = np.column_stack([values[:, :2], np.unwrap(values[:, 2])])
    scale = np.quantile(np.abs(np.diff(values, axis=0)), 0.95, axis=0) + 1e-12
    scaled = values / scale
    size = np.abs(np.diff(scaled, axis=0)).max(axis=1)
    largest = np.sort(np.argsort(-size)[: int(np.sqrt(len(size)))])  # of which there are no more pairs than steps
    limit = LEAP * np.quantile(size, 0.99)
    best = None
    for a, b in combinations(largest[size[largest] > limit].tolist(), 2):
        before = np.hypot(size[a], size[b])
        after = np.hypot(np.abs(scaled[a] - scaled[b]).max(), np.abs(scaled[a + 1] - scaled[b + 1]).max())
        if LEAP * after < before and (best is None or after < best[0]):
            best = after, a, b
    if best is not None and best[2] - best[1] > 2:
        since, until = float(channel.t[best[1] + 1]), float(channel.t[best[2]])
        yield Finding("rows_reversed", "rows in the opposite order", name, since, until,
                      repairs=(Mirrored(name, since, until),))


def _stuck(run: Recording, name: str, may_rest: bool) -> Iterator[Finding]:
    """A noisy channel that repeats itself: for a while, all of it or a column, or a column of it always.

    The torque of a controller rests while the wheels do; may_rest: it may be constant at any time.
    """
    channel, encoder = run.channels[name], run.channels.get("encoder")
    dead = [c for c in channel.columns if np.ptp(channel.column(c)) == 0.0 and not (may_rest and channel.column(c)[0])]
    if dead:
        values = ", ".join(f"{column} is always {channel.column(column)[0]:.4g}" for column in dead)
        yield Finding("channel_dead", values, name, repairs=(Without(name),))
        return
    if may_rest and not np.ptp(channel.values, axis=0).all():
        return
    found, parts = [], [("rows repeat", channel.values)]
    if encoder is not None and not may_rest:
        parts += [(f"{column} repeats", channel.column(column)[:, None]) for column in channel.columns]
    for what, values in parts:
        again, low, high = repeats(values), values.min(axis=0), values.max(axis=0)
        for first, last in stretches(again):
            since, until, held = float(channel.t[first]), float(channel.t[last]), values[first]
            if until - since < STUCK_S or holds_by_chance(again, last - first):
                continue
            if any(a <= since and until <= b for a, b in found):  # a column of rows that repeat
                continue
            inside = None if encoder is None else encoder.values[(encoder.t >= since) & (encoder.t < until)]
            if values is not channel.values and (_often(again, last - first) or not _all_turn(inside)):
                continue
            if name == "torque" and inside is not None and len(inside) and not np.ptp(inside, axis=0).any():
                continue
            if held.any() and not np.all((held == low) | (held == high)):
                found.append((since, until))
                yield Finding("channel_frozen", what, name, since, until,
                              repairs=(CutOut(since, until),))


def _often(again, rows):
    """Whether a column repeats itself in other rows than so many in turn as well: it is not noisy."""
    return LEAP * (np.sum(again) - rows) >= len(again) - rows


def _all_turn(angles):
    """Whether every wheel turns by more than a count; angles: (n, wheels) of a stretch."""
    return len(angles) > 1 and all(np.ptp(angle) > step_of(angle) for angle in angles.T)


def holds_by_chance(again: np.ndarray, rows: int) -> bool:
    """Whether a channel repeats itself so often that it does so for so many rows in turn by chance.

    again: (n,) whether each row is the same as the one before.
    """
    others = len(again) - rows
    return others == 0 or len(again) * ((np.sum(again) - rows) / others) ** rows >= CHANCE


def _leaps(channel: Channel, longest_s: float = np.inf) -> np.ndarray:
    """(n - 1, wheels) whether an angle leaps from a row to the next.

    Few of its steps do, each by itself, and all others are far smaller. A step over a longer time may be as much
    longer, but for those over longest_s. Steps are those between rows at which an angle changes; where these are so far
    apart that a wheel may start and stop between two, nothing leaps.
    """
    found = np.zeros((len(channel.t) - 1, len(channel.columns)), bool)
    rows = np.flatnonzero(np.append(True, ~repeats(channel.values)))
    apart = np.diff(channel.t[rows])
    if len(rows) <= 2 or np.median(apart) > RATE_S:
        return found
    longer = np.where(apart < longest_s, np.maximum(apart / np.median(apart), 1.0), 1.0)
    steps = np.abs(np.diff(channel.values[rows], axis=0)) / longer[:, None]
    largest = -np.sort(-steps, axis=0)[: int(np.sqrt(len(steps))) + 1]
    far = (largest[:-1] > LEAP * largest[1:]) & (largest[1:] > 0.0)  # a wheel that hardly moves makes single counts
    leaps = steps > LEAP * np.where(far, largest[1:], np.inf).min(axis=0)
    around = np.zeros_like(leaps)  # a motion that is fast for some rows is none
    around[1:] |= leaps[:-1]
    around[:-1] |= leaps[1:]
    found[rows[1:] - 1] = leaps & ~around
    return found


def _stopped(channel: Channel) -> Iterator[Finding]:
    """Angles, of one wheel or of all, that repeat and then leap to where the wheels have gone meanwhile."""
    leaps, still = _leaps(channel, STUCK_S), np.diff(channel.values, axis=0) == 0.0
    for first, last in sorted({part for own in still.T for part in stretches(own)}):
        since, until = float(channel.t[first]), float(channel.t[last])
        if until - since < STUCK_S or last >= len(leaps):
            continue
        stopped = leaps[last] & still[first:last].all(axis=0)
        if stopped.any():
            names = "rows" if still[first:last].all() else _named(channel, stopped)
            what = f"{names} repeats, then leaps" if names in channel.columns else f"{names} repeat, then leap"
            yield Finding("channel_frozen", what, "encoder", since, until,
                          repairs=(CutOut(since, float(channel.t[last + 1])),))


def _named(channel: Channel, some: np.ndarray) -> str:
    """Names of some columns, in words."""
    return ", ".join(name for name, one in zip(channel.columns, some, strict=True) if one)


def _set_anew(channel: Channel) -> Iterator[Finding]:
    """Angles that leap from one row to the next."""
    leaps = _leaps(channel)
    for k in np.flatnonzero(leaps.any(axis=1)).tolist():
        since, until = float(channel.t[k]), float(channel.t[k + 1])
        if until - since > RATE_S:  # rows are missing
            continue
        what = f"{_named(channel, leaps[k])} leap{'s' if leaps[k].sum() == 1 else ''}, as no wheel can turn"
        yield Finding("counter_reset", what, "encoder", since, until, repairs=(CutOut(since, until),))


def _clipped(name: str, channel: Channel) -> Iterator[Finding]:
    """Columns that stay at one extreme value, more often than chance takes them there than to the value beside it."""
    found = []
    for column in channel.columns:
        values = channel.column(column)
        levels = np.unique(values)
        for extreme, beside in (levels[:-3:-1], levels[:2]) if len(levels) > _STEPS else ():
            at = values == extreme
            next_to_it = np.sum(values == beside)
            if at.sum() - next_to_it > CERTAIN * np.sqrt(at.sum() + next_to_it) and at[1:][at[:-1]].any():
                found.append(f"{column} at {extreme:.4g}")
    if found:
        yield Finding("channel_clipped", ", ".join(found), name)


def quantised_findings(run: Recording, counts_per_turn: float) -> Iterator[Finding]:
    """Columns in steps that are coarse beside what they tell, or beside the encoder's counts."""
    for name, channel in run.channels.items():
        if name not in ("encoder", "kinect", *_NOISY):
            continue
        coarse = []
        for column in channel.columns[: 3 if name == "kinect" else None]:
            values = channel.column(column)
            step = step_of(values)
            is_coarse = step > max(np.ptp(values) / _STEPS, _FINE if name == "kinect" else 0.0)
            if name == "encoder" and counts_per_turn > 0.0:
                is_coarse = round(step * counts_per_turn / (2.0 * np.pi)) > 1
            if is_coarse:
                coarse.append(f"{column} in steps of {step:.3g}")
        if coarse:
            yield Finding("channel_quantised", ", ".join(coarse), name)


def repeats(values: np.ndarray) -> np.ndarray:
    """(n - 1,) whether each row of (n, d) values but the first is the same as the one before."""
    return ~np.diff(values, axis=0).any(axis=1)


def stretches(flags: np.ndarray) -> list[tuple[int, int]]:
    """First and last sample of every stretch in which flags (n - 1,), one for each pair of neighbours, hold."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def come_in_step(flags: np.ndarray) -> bool:
    """Whether flags (n,) hold in ten or more stretches that are about as long, one after the other."""
    lengths = [last - first for first, last in stretches(flags)]
    if len(lengths) < 10:
        return False
    return bool(np.ptp(np.quantile(lengths, [0.1, 0.9])) <= 2 and 2 * flags.sum() >= len(flags))
