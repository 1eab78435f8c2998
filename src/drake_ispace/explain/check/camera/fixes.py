"""What the fixes of a camera show from one to the next: places and headings that are off, headings that are turned, and
headings that are none."""

from collections.abc import Iterator

import numpy as np

from drake_ispace.blocks.frames import wrap
from drake_ispace.explain.check.compare.links import Base
from drake_ispace.explain.check.compare.motion import WINDOW_S, has_motion, step_of
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Dropped, Turned, Without
from drake_ispace.files.recording import Recording

_SPIKE_STEPS = 5.0  # larger than most
_QUARTER = 0.5 * np.pi
_SAME = 0.02  # of what noise changes
_BLOCK, _MOST_BLOCKS = 100, 40  # of fixes whose headings are looked at


def outlier_findings(run: Recording) -> Iterator[Finding]:
    """Fixes whose place or heading is off and comes back soon: the camera alone shows them, in any unit.

    A heading that is off by less than an eighth of a turn may be a motion.
    """
    kinect = run.channels.get("kinect")
    if kinect is None or len(kinect.t) < 2:
        return
    place, phi = kinect.values[:, :2], kinect.column("phi")
    rounded = 2.0 * max(step_of(column) for column in place.T)  # makes less of no motion
    in_radians = np.ptp(phi) <= 6.0 * _QUARTER  # a turn to wrap by and half a turn; beyond, headings may be in degrees

    def spikes_of(left):
        """The groups among these fixes."""
        t, at, angle = kinect.t[left], place[left], phi[left]
        spikes = _spikes(t, lambda i, j: np.linalg.norm(at[j] - at[i], axis=-1), least=rounded)
        if in_radians:
            spikes += _spikes(t, lambda i, j: np.abs(wrap(angle[j] - angle[i])), 0.5 * _QUARTER)
        return spikes

    left, found = np.arange(len(place)), []
    while len(left) > 1 and (spikes := spikes_of(left)):  # of two in a row one may stand out without the other alone
        found += [(int(left[a]), int(left[b])) for a, b in spikes]
        left = np.delete(left, np.concatenate([np.arange(a, b + 1) for a, b in spikes]))
    if found:
        yield off(kinect.t, sorted(set(found)))


def _spikes(t, distance, no_motion=None, least=0.0):
    """The first and the last fix of each group that is off, the shortest groups first.

    distance: between fixes i and j. no_motion: what no motion makes from one fix to the next; after such a step near
    the run's begin, or before one near its end, fixes are right, and those beyond it are off. None: not known. least:
    a step that is not large.
    """
    k = np.arange(len(t) - 1)
    steps = distance(k, k + 1)
    usual = np.quantile(steps[_goes_on(distance, steps)], 0.9)
    is_large = steps > max(no_motion or least, _SPIKE_STEPS * usual)
    for i in np.flatnonzero(is_large).tolist():  # and of a robot that shakes for a while only what is large meanwhile
        near = slice(*np.searchsorted(t[:-1], [t[i] - WINDOW_S, t[i + 1] + WINDOW_S]))
        is_large[i] = steps[i] > _SPIKE_STEPS * np.median(steps[near])
    large = np.flatnonzero(is_large)
    ends = np.searchsorted(t[large], t[large + 1] + WINDOW_S, side="right")
    pairs = [(int(large[m]), int(j)) for m, end in enumerate(ends) for j in large[m + 1 : end]]
    spikes, used = [], set()
    for i, j in sorted(pairs, key=lambda pair: (pair[1] - pair[0], pair)):
        if not used & {i, j} and distance(i, j + 1) < 0.5 * steps[i]:
            spikes.append((i + 1, j))
            used |= {i, j}
    left = [i for i in large.tolist() if i not in used and no_motion]
    if left and t[left[0]] - t[0] <= WINDOW_S:
        spikes.append((0, left.pop(0)))
    if left and t[-1] - t[left[-1] + 1] <= WINDOW_S:
        spikes.append((left[-1] + 1, len(t) - 1))
    return spikes


def _goes_on(distance, steps):
    """(k,) which steps neither go to a single fix from where the next one comes back, nor come back; else all.

    A step there and one back tell of no motion: of every tenth fix that is off, a fifth of all steps.
    """
    k = np.arange(len(steps) - 1)
    alone = distance(k, k + 2) < 0.5 * np.minimum(steps[:-1], steps[1:])
    back = np.append(alone, False) | np.append(False, alone)
    return ~back if np.count_nonzero(back) < 0.5 * len(back) else np.ones(len(back), bool)


def off(t, spikes):
    """The Finding that fixes are off; spikes: the first and the last of them, of each group."""
    repairs = tuple(Dropped("kinect", float(t[a]), float(t[b])) for a, b in spikes)
    count = sum(b - a + 1 for a, b in spikes)
    what = f"{count} fixes are off" if count > 1 else "a fix is off"
    return Finding("camera_outliers", what, "kinect", repairs[0].from_s, repairs[-1].to_s,
                   repairs=repairs)


def turned_findings(run: Recording, base: Base | None) -> Iterator[Finding]:
    """Headings that are off by a quarter or a half turn for a while, as those of a marker that looks the same turned.

    The heading changes and the place does not, nor do the wheels turn the robot. What most fixes say counts as right.
    """
    if base is None or not has_motion(run):
        return
    kinect = run.channels["kinect"]
    t, place, phi = kinect.t, kinect.values[:, :2], kinect.column("phi")
    wheels = base.moved(t[:-1], t[1:])[:, 2]
    if np.ptp(phi) > 6.0 * _QUARTER + 2.0 * np.ptp(np.cumsum(wheels)):  # not in radians
        return
    turned = np.diff(phi) - wheels
    quarters, ways = np.rint(turned / _QUARTER), np.linalg.norm(np.diff(place, axis=0), axis=1)
    beside = np.abs(turned - _QUARTER * quarters)
    usual, far = (_SPIKE_STEPS * np.quantile(sizes, 0.9) for sizes in (beside, ways))
    if usual > 0.5 * _QUARTER or np.mean(quarters % 4 != 0) > 0.5:  # at random, at most half of the steps are jumps
        return
    quarters[(np.diff(t) > WINDOW_S) | (beside > usual) | (ways > far)] = 0
    for since, until in base.spoilt:
        quarters[(t[1:] > since) & (t[:-1] < until)] = 0
    sides = np.append(0, np.cumsum(quarters)).astype(int) % 4
    off_by = (sides - np.bincount(sides).argmax() + 1) % 4 - 1  # from a quarter turn back to half a turn
    same = [part for part in np.split(np.arange(len(t)), np.flatnonzero(np.diff(sides)) + 1) if off_by[part[0]]]
    if same:
        repairs = tuple(Turned("kinect", float(t[part[0]]), float(t[part[-1]]), float(-_QUARTER * off_by[part[0]]))
                        for part in same)
        what = f"phi of {sum(map(len, same))} fixes is off by a quarter or a half turn"
        yield Finding("heading_offset", what, "kinect", repairs[0].from_s, repairs[-1].to_s,
                      repairs=repairs)


def course_findings(run: Recording) -> Iterator[Finding]:
    """Headings that were computed from the places: directions from fix to fix, or over a few of them, noise and all.

    The heading of a robot that drives ahead is near these directions, but has no part in their noise.
    """
    kinect = run.channels.get("kinect")
    if kinect is None or len(kinect.t) < 5:
        return
    place, phi = kinect.values[:, :2], kinect.column("phi")
    longest = min(max(int(np.searchsorted(kinect.t, kinect.t[0] + WINDOW_S)), 2), len(place) - 3)
    blocks = np.array_split(np.arange(len(place) - longest), -(-len(place) // _BLOCK))
    some = np.concatenate(blocks[:: -(-len(blocks) // _MOST_BLOCKS)])  # of a long run, from all over it
    if _are_courses(np.gradient(place, kinect.t, axis=0)[some], [phi[some]]) or any(
        _are_courses(place[some + k] - place[some], [phi[some + at] for at in {0, k // 2, k}])
        for k in range(1, longest + 1)
    ):
        what = "phi is the direction in which the place moves"
        yield Finding("heading_is_course", what, "kinect", repairs=(Without("kinect"),))


def _are_courses(ways, headings) -> bool:
    """Whether one of the headings, each (n,), changes as the direction of `ways` (n, 2) does, and when it does.

    Not where most of `ways` are none, or all are in one direction.
    """
    moved = ways.any(axis=1)
    if np.count_nonzero(moved) < max(0.5 * len(moved), 3):
        return False
    course = np.unwrap(np.arctan2(*ways[moved].T[::-1]))
    turns = np.diff(course)
    changes = turns != 0.0
    if not changes.any():
        return False
    # beside an axis along which all is larger, directions turn round or not at all: of what most do, nothing is noise
    noise = min(np.median(np.abs(np.diff(turns))), np.median(np.abs(turns[changes])))
    return any(
        np.median(np.abs(wrap(np.diff(heading[moved]) - turns)[changes])) < _SAME * noise for heading in headings
    )
