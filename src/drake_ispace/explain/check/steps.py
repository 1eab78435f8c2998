"""What camera and wheels show of each other over short times: jumps, a channel that stops, hands."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from drake_ispace.blocks.frames import rotated
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.camera.fixes import off
from drake_ispace.explain.check.compare.frames import latency_of
from drake_ispace.explain.check.compare.links import (
    FEWEST,
    LATENCIES_S,
    SERIES,
    Base,
    camera_link,
    inside,
    moving,
    seen_of_wheels,
)
from drake_ispace.explain.check.compare.motion import (
    WINDOW_S,
    arm,
    between,
    camera_noise,
    correlated,
    has_motion,
    seen,
    seen_along,
    seen_at_ends,
    turned,
    windows,
    within,
)
from drake_ispace.explain.check.compare.regression import CAMERA, MOST_SLACK, SLACK, residuals
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.sampling.samples import STUCK_S, holds_by_chance, repeats, stretches
from drake_ispace.explain.levels import CERTAIN, CHANCE, largest_by_chance
from drake_ispace.faults.repair import CutOut, Dropped, Without, repaired
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import COMMAND, TORQUE

SHOWS_M = 0.12  # way of a wheel, or of the robot, that must show
APART = 2.0  # times the next smaller one of a run, and what chance makes, from which on a short step stands out


def dead_findings(run: Recording, base: Base | None) -> Iterator[Finding]:
    """Wheels, a camera or a command that never move although another one, or a torque of more than one value, does."""
    if base is None:
        return
    if not base.robot.in_room and TORQUE in run.channels and np.ptp(run.channels[TORQUE].values, axis=0).any():
        encoder = run.channels["encoder"]
        still = [column for column in encoder.columns if np.ptp(encoder.column(column)) == 0.0]
        if still:
            yield Finding("channel_dead", f"{', '.join(still)} never changes", "encoder",
                          repairs=(Without("encoder"),))
    if not base.robot.in_room:
        return
    radius = min(wheel.radius_m for wheel in base.geometry.wheels)
    command = run.channels.get(COMMAND) if base.robot.driven == COMMAND else None
    if command is not None and len(command.t) and not command.values.any():
        if np.ptp(run.channels["encoder"].values, axis=0).max() * radius > SHOWS_M:
            yield Finding("channel_dead", "it is always 0, and the wheels turn", COMMAND,
                          repairs=(Without(COMMAND),))
    if not has_motion(run):
        return
    kinect = run.channels["kinect"]
    if dead := _dead_wheels(kinect, base, radius):
        yield Finding("channel_dead", f"{', '.join(dead)} never changes", "encoder",
                      repairs=(Without("encoder"),))
    whole = windows(kinect)
    moved = base.moved(whole.since_s, whole.until_s)
    if not np.ptp(kinect.values[:, :2], axis=0).any() and np.linalg.norm(moved[:, :2], axis=1).sum() > SHOWS_M:
        yield Finding("channel_dead", "the place never changes", "kinect", repairs=(Without("kinect"),))
    elif not np.ptp(kinect.values[:, 2]):
        headings = np.cumsum(moved[:, 2])
        if np.ptp(headings) * radius / np.abs(base.geometry.forward[2]).max() > SHOWS_M:
            what = "the heading never changes, and the wheels turn the robot"
            yield Finding("channel_dead", what, "kinect", repairs=(Without("kinect"),))


def _dead_wheels(kinect, base, radius) -> list[str]:
    """Names of the wheels whose angle never changes although the camera sees them turn, wherever its marker is.

    How far the marker goes along as the robot turns is told by the wheels whose angles change; where that would be
    farther than a marker can be, or no angle changes, by those that seem to stand. Physics may make a share of the
    way of another wheel look like a way of one that stands.
    """
    encoder, geometry, whole = base.encoder, base.geometry, windows(kinect)
    still = np.ptp(encoder.values, axis=0) == 0.0
    if not still.any() or not len(whole.first):
        return []
    motion, own = seen_along(kinect, whole), turned(encoder, whole.since_s, whole.until_s)
    ways, of_marker = motion @ geometry.inverse.T, motion[:, 2, None, None] * geometry.inverse[:, :2]
    inner = within(encoder, whole)

    def marker(wheels):
        apart = (ways - own)[inner][:, wheels].ravel()
        return np.linalg.lstsq(of_marker[inner][:, wheels].reshape(-1, 2), apart, rcond=None)[0]

    farthest = MOST_SLACK / SLACK * CAMERA.marker * arm(geometry)
    place = marker(still if still.all() else ~still)
    if np.linalg.norm(place) > farthest:
        place = marker(still)
        place *= min(1.0, farthest / np.linalg.norm(place))
    ways = (ways - of_marker @ place) * radius
    noise = np.sqrt(2.0) * np.linalg.norm(camera_noise(kinect) * geometry.inverse, axis=1) * radius
    far = np.abs(ways).sum(axis=0)
    least = max(SHOWS_M, MOST_SLACK * far.max())
    return [name for i, name in enumerate(encoder.columns)
            if still[i] and far[i] > least and moving(ways[:, [i]], noise[[i]])]


def frozen_camera(run: Recording, base: Base | None) -> Iterator[Finding]:
    """Fixes that repeat while the wheels turn; all but the first of them are left out.

    Wheels that turn by next to nothing are enough where fixes repeat by no chance: where there is noise in them, which
    shows while the wheels rest. A camera that shows no noise may pass small motions over.
    """
    if base is None or not has_motion(run):
        return
    kinect = run.channels["kinect"]
    again = repeats(kinect.values[:, :3])
    rests = ~base.moved(kinect.t[:-1], kinect.t[1:]).any(axis=1)
    is_noisy = 2 * np.sum(again & rests) <= np.sum(rests)
    digits = [np.diff(np.unique(column)).min(initial=np.inf) for column in kinect.values[:, :3].T]
    for first, last in stretches(again):
        since, until = float(kinect.t[first]), float(kinect.t[last])
        if until - since < STUCK_S or not _part(run, since, until):
            continue
        t = kinect.t[first : last + 1]
        moved = np.ptp(base.moved(np.full_like(t, since), t), axis=0)
        shows = (moved > CERTAIN * base.noise + digits).any()
        if (shows and is_noisy and not holds_by_chance(again, last - first)) or np.linalg.norm(moved[:2]) > SHOWS_M:
            yield Finding("channel_frozen", "fixes repeat", "kinect", since, until,
                          repairs=(Dropped("kinect", float(kinect.t[first + 1]), until),))


def step_findings(run: Recording, base: Base | None) -> Iterator[Finding]:
    """Faults that are limited in time, as camera and wheels tell them."""
    if base is None or not has_motion(run):
        return
    seen_of = seen_of_wheels(run, base)
    stopped = list(_frozen(run, base, seen_of))
    yield from stopped
    ends = [(f.from_s - WINDOW_S, f.to_s + WINDOW_S) for f in stopped]
    steps = [step for step in _camera_steps(run, base, seen_of)
             if not any(a <= step.from_s and step.to_s <= b for a, b in ends)]
    alone = not stopped and all(step.fault != "counter_reset" for step in steps)  # a clock that is off shows rests, too
    apart = _apart(run, base, seen_of, steps) if alone else []
    yield from (step for step in steps if step.fault != "camera_jump" or not any(_in(step, one) for one in apart))
    yield from apart


def _apart(run, base, seen_of, steps):
    """Stretches in which camera and wheels tell of different motions, whatever single fixes are off.

    Beside jumps of the place they are those of which something is left once all jumps are taken back: wheels that slide
    for seconds make some steps that look like jumps. seen_of: as of `_camera_steps`.
    """
    jumps = [step for step in steps if step.fault == "camera_jump"]
    run = repaired(run, (repair for step in steps if step.fault == "camera_outliers" for repair in step.repairs))
    found = list(_carried(run, base))
    if not (found and jumps):
        return found
    left = list(_carried(_without_jumps(run, base, seen_of, jumps), base))
    return [one for one in found if any(one.from_s < other.to_s and other.from_s < one.to_s for other in left)]


def _in(step, stretch):
    return stretch.from_s <= step.from_s and step.to_s <= stretch.to_s


def _without_jumps(run, base, seen_of, jumps):
    """The run with places that go on, in the steps in which they jump, as the wheels do."""
    kinect = run.channels["kinect"]
    values, phi = kinect.values.copy(), np.unwrap(kinect.column("phi"))
    for jump in jumps:
        i = int(np.searchsorted(kinect.t, jump.to_s))
        moved = base.moved(kinect.t[[i - 1]], kinect.t[[i]]) @ seen_of
        goes_on = values[i - 1, :2] + rotated(moved[:, :2], phi[[i - 1]] + 0.5 * moved[:, 2])[0]
        values[i:, :2] += goes_on - values[i, :2]
    return replace(run, channels=run.channels | {"kinect": replace(kinect, values=values)})


def _camera_steps(run, base, seen_of):
    """Places that change from one fix to the next without the wheels, and fixes that are off where they change back.

    Where the wheels are as fast as never else, and the robot is not, and most of it is from one row of the wheels to
    the next, their counter has changed instead.

    seen_of: what `seen_of_wheels` gives of the run.
    """
    kinect = run.channels["kinect"]
    k = np.arange(len(kinect.t))
    each = between(kinect, k[:-1], k[1:])
    short = (each.until_s - each.since_s <= 2.0) & inside(base, each.since_s, each.until_s)
    wheels_ways = base.moved(each.since_s, each.until_s) @ seen_of
    readings = np.stack([way_of(kinect, each) for way_of in (seen, seen_along)])  # over lost fixes it turns unseen
    apart = np.linalg.norm((readings - wheels_ways)[..., :2], axis=2)
    difference, ways = apart.min(axis=0), readings[apart.argmin(axis=0), np.arange(len(k) - 1)]
    usual = max(float(np.linalg.norm(camera_noise(kinect)[:2])), float(np.median(difference)))
    most = largest_by_chance(len(k), 2) * usual
    is_far = difference > max(SHOWS_M, most)
    is_large = short & (is_far | _small_jumps(base, seen_of, each, ways, np.where(short, difference, np.nan), most))
    faster = [
        speed > speed[short & ~is_large].max(initial=0.0) for speed in (
            np.linalg.norm(of[:, :2], axis=1) / np.maximum(each.until_s - each.since_s, TICK_S)
            for of in (ways, wheels_ways)
        )
    ]
    spikes = []
    for i in np.flatnonzero(is_large).tolist():
        since, until = float(kinect.t[i]), float(kinect.t[i + 1])
        spike = _spike(kinect, base, seen_of, i, difference[i])
        if spike is not None:
            if is_far[i]:  # of a late camera a short dash of the wheels goes and comes back, too
                spikes.append(spike)
            continue
        if faster[1][i] and not faster[0][i]:
            row = largest_step(run.channels["encoder"], since, until)
            of_row = np.linalg.norm((base.moved(*map(np.atleast_1d, row)) @ seen_of)[0, :2])
            if of_row > 0.5 * difference[i]:
                what = "angles of the wheels change at once, and the place does not"
                yield Finding("counter_reset", what, "encoder", *row, repairs=(CutOut(*row),))
                continue
        what = f"the place jumps by {difference[i]:.3g} m"
        yield Finding("camera_jump", what, "kinect", since, until, repairs=(CutOut(since, until),))
    if spikes:
        yield off(kinect.t, list(dict.fromkeys(spikes)))  # a step away and one back are the same spike


def _small_jumps(base, seen_of, steps, ways, differences, most):
    """Which steps (k,) of the camera are at once, far beyond all smaller ones and beyond `most` [m], and alone.

    Whatever usual latency the camera has: wheels that start at once lead a late one. A step over lost fixes is not at
    once, and none to be compared with.

    ways, differences: (k, 3), (k,) as the camera sees each, and beside the wheels', NaN for one that does not count.
    most: that chance makes of a step.
    """
    lasts, known = steps.until_s - steps.since_s, np.isfinite(differences)
    at_once = known & (lasts <= min(1.5 * np.median(lasts[known]), WINDOW_S)) if known.any() else known
    ordered = np.sort(differences[at_once])
    lower = np.maximum(np.concatenate([[0.0], ordered])[: len(ordered)], most)
    far = at_once & (differences >= ordered[ordered > APART * lower].min(initial=np.inf))
    which = np.zeros_like(far)
    for i in np.flatnonzero(far):
        since, until = steps.since_s[i], steps.until_s[i]
        if (far & (steps.since_s < until + WINDOW_S) & (steps.until_s > since - WINDOW_S)).sum() == 1:
            left = ways[i] - base.moved(since + LATENCIES_S, until + LATENCIES_S) @ seen_of
            which[i] = np.linalg.norm(left[:, :2], axis=1).min() > APART * most
    return which


def largest_step(encoder, since_s, until_s):
    """(since, until) the rows [s] between which angles change most, about a time."""
    steps = np.abs(np.diff(encoder.values, axis=0)).max(axis=1)
    between = np.flatnonzero((encoder.t[1:] > since_s) & (encoder.t[:-1] < until_s))
    k = int(between[steps[between].argmax()])
    return float(encoder.t[k]), float(encoder.t[k + 1])


def _unexplained(kinect, base, seen_of, pairs):
    """(k,) distance [m] between fixes, as the camera sees the ways, and as the wheels make them.

    Fixes between them may be off.
    """
    ways = seen_at_ends(kinect, pairs) - base.moved(pairs.since_s, pairs.until_s) @ seen_of
    return np.linalg.norm(ways[:, :2], axis=1)


def _spike(kinect, base, seen_of, i, step):
    """The first and the last fix that are off, where a step [m] after fix `i` goes or comes back soon; else None."""
    t = kinect.t
    first, last = np.searchsorted(t, t[i] - WINDOW_S), np.searchsorted(t, t[i + 1] + WINDOW_S, side="right")
    spans = [(i, j) for j in range(i + 2, min(last + 1, len(t)))] + [(j, i + 1) for j in range(max(first - 1, 0), i)]
    if not spans:
        return None
    begins, ends = np.array(sorted(spans, key=lambda span: span[1] - span[0])).T
    left = _unexplained(kinect, base, seen_of, between(kinect, begins, ends))
    back = np.flatnonzero(left < 0.5 * step)
    return (int(begins[back[0]]) + 1, int(ends[back[0]]) - 1) if len(back) else None


def _frozen(run, base, seen_of):
    """Rows of the encoder that repeat while the camera moves; seen_of: as of `_camera_steps`."""
    kinect, encoder = run.channels["kinect"], run.channels["encoder"]
    of_seen = np.linalg.pinv(seen_of)
    noise = np.sqrt(correlated(kinect)) * camera_noise(kinect)  # as if those of all fixes were independent
    for wheel, column in [(None, slice(None)), *((i, slice(i, i + 1)) for i in range(len(encoder.columns)))]:
        for first, last in stretches(repeats(encoder.values[:, column])):
            since, until = float(encoder.t[first]), float(encoder.t[last])
            first_fix, end = np.searchsorted(kinect.t, [since, until])
            if until - since < STUCK_S or end - first_fix < 2:
                continue
            fixes = np.arange(first_fix, end)
            own = base.geometry.inverse[column] @ of_seen.T  # of the wheels that repeat, per motion that is seen
            radius = min(wheel.radius_m for wheel in base.geometry.wheels)
            ways = seen_along(kinect, between(kinect, np.full_like(fixes, first_fix), fixes)) @ own.T * radius
            missed = np.abs(ways[-1]).max()
            if missed < SHOWS_M or not _moves_on(ways, np.linalg.norm(noise * own, axis=1) * radius):
                continue
            after = np.abs(np.diff(encoder.values[last : last + 2, column], axis=0)).max(initial=0.0) * radius
            jumps = after > 0.5 * missed
            if wheel is None and not jumps:
                what = "the camera sees a motion that no wheel makes"
                yield Finding("robot_carried", what, "all", since, until,
                              repairs=(CutOut(since, until),))
            else:
                names = "rows repeat" if wheel is None else f"{encoder.columns[wheel]} repeats"
                yield Finding("channel_frozen", names, "encoder", since, until,
                              repairs=(CutOut(since, until),))
            if wheel is None:
                return


def _moves_on(ways, noise):
    """Whether ways (n, wheels) [m], which fixes tell, are others from one fix on, beyond what noise (wheels,) makes."""
    before = np.arange(1, len(ways))[:, None]
    after, sums = len(ways) - before, np.cumsum(ways, axis=0)
    apart = np.abs((sums[-1] - sums[:-1]) / after - sums[:-1] / before)
    usual = noise * np.sqrt(1.0 / before + 1.0 / after)
    return bool((apart > norm.isf(0.5 * CHANCE / apart.size) * usual).any())


def _carried(run, base):
    """Stretches in which camera and wheels tell of different motions, which differ by more than they have in common.

    They reach as far as the motions differ by more than chance: a robot that drives on has most in common with a push.
    A camera may be late.
    """
    link = camera_link(run, base, SERIES, way_of=seen_along)  # of a robot that spins a chord is no way
    lag_s = latency_of(run, base)
    kept = inside(base, link.since_s + lag_s, link.until_s + lag_s)
    if kept.sum() < FEWEST * SERIES:
        return
    since, until, y = link.since_s[kept], link.until_s[kept], link.measured[kept]
    x = link.predicted(since + lag_s, until + lag_s)
    left = residuals(x, y, slack=link.slack)
    size, unusual, far = np.linalg.norm(left, axis=1), np.zeros(len(left), bool), np.zeros(len(left), bool)
    for group in map(list, link.groups):
        part, larger = np.linalg.norm(left[:, group], axis=1), np.maximum(*(
            np.linalg.norm(motion[:, group], axis=1) for motion in (x, y)))
        usual = largest_by_chance(len(part), len(group)) * max(np.median(part), link.noise[group].max())
        unusual |= part > usual
        far |= (part > usual) & (part > larger - part)
    spans: list[list[int]] = []  # the first and the last window of each, and of what tells it
    for first, last in stretches(far):
        last -= 1
        if last < first or (spans and first <= spans[-1][1]):
            continue
        total = float(size[first : last + 1].max()) if last == first else float(size[first : last + 1].sum() / SERIES)
        if max(total, float(size[first : last + 1].max())) < SHOWS_M or not _part(run, since[first], until[last]):
            continue
        begin, end = first - _count(unusual[:first][::-1]), last + _count(unusual[last + 1 :])
        span = [begin, end, first, last] if _part(run, since[begin], until[end]) else [first, last, first, last]
        if spans and since[span[0]] < until[spans[-1][1]] and _part(run, since[spans[-1][0]], until[span[1]]):
            spans[-1][1::2] = span[1::2]
        else:
            spans.append(span)
    for begin, end, first, last in spans:
        moved = np.linalg.norm(x[first : last + 1], axis=1).sum(), np.linalg.norm(y[first : last + 1], axis=1).sum()
        lifted = moved[1] < moved[0] - moved[1]  # the robot goes less far than it fails to
        fault, what, rival = "robot_carried", "camera and wheels tell of different motions", "robot_lifted"
        if lifted:
            fault, what, rival = "robot_lifted", "it goes about half as far as they tell, or less", "robot_carried"
        a, b = float(since[begin]) + min(lag_s, 0.0), float(until[end]) + max(lag_s, 0.0)  # wheels have other stamps
        yield Finding(fault, what, "all", a, b, rivals=(rival,), repairs=(CutOut(a, b),))


def _count(flags: np.ndarray) -> int:
    """How many flags hold before the first one that does not."""
    return len(flags) if flags.all() else int(np.argmin(flags))


def _part(run, since_s, until_s):
    """Whether a time is a stretch of a run: no more of the camera's time than the rest."""
    t = run.channels["kinect"].t
    return until_s - since_s <= (t[-1] - t[0]) - (until_s - since_s)


def apart_in(run: Recording, steps: Sequence[Finding]) -> list[tuple[float, float]]:
    """Stretches [s] in which wheels and camera of a run tell of different motions; none if these are most of it."""
    found = [stretch for finding in steps for stretch in finding.stretches]
    lasts_s = np.ptp(run.channels["kinect"].t) if found else 0.0
    return found if sum(until - since for since, until in found) < 0.5 * lasts_s else []
