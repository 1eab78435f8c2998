"""Long recordings: stretches of them stand for the whole.

What a diagnosis costs grows with the ticks that it looks at, and what a run tells soon repeats itself. Recordings that
last longer than is needed are therefore cut into stretches, and as many as are needed are taken from all over them. The
others are unseen runs, on which an answer can be proved.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.predict.room_view import LEAD_TICKS
from drake_ispace.explain.predict.tracks import Track

MOST_S = 160.0  # of training runs: twice as much as the four runs of 20 s that nearly every effect is found in
STRETCH_S = 20.0  # as long as a run is as a rule
_FIRST_TICKS = 4
_MOVING = 0.2  # of the root mean square speed of all wheels: faster, a robot was not at rest


def stretches_of(
    tracks: Sequence[Track], most_s: float, wheels: int, settling_ticks: int
) -> tuple[list[Track], list[Track]]:
    """Stretches of the tracks, `most_s` [s] altogether at most, and half as much of what is left.

    Tracks that are no longer than that are returned as they are, and nothing is left. Stretches lie evenly along the
    way that the wheels have turned: a robot at rest tells little.

    wheels: the first columns of what was measured. settling_ticks: ticks, as `stretch` takes them.
    """
    if sum(track.ticks for track in tracks) * TICK_S <= most_s:
        return list(tracks), []
    parts = [part for track in tracks for part in _parts(track, settling_ticks)]
    count = int(most_s * len(parts) / (sum(track.ticks for track in tracks) * TICK_S))
    chosen = _evenly(parts, wheels, max(count, 1))
    others = [part for i, part in enumerate(parts) if i not in chosen]
    spare = _evenly(others, wheels, max(count // 2, 1)) if others else []
    return [parts[i] for i in chosen], [others[i] for i in spare]


def in_stretches(tracks: Sequence[Track], settling_ticks: int) -> list[Track]:
    """All of the tracks, those that last longer than two stretches cut into stretches.

    Whatever is unknown of a moment costs as much as its run is long. settling_ticks: ticks, as `stretch` takes them.
    """
    return [
        part for track in tracks
        for part in (_parts(track, settling_ticks) if track.ticks * TICK_S > 2.0 * STRETCH_S else [track])
    ]


def _evenly(parts, wheels, count) -> list[int]:
    """Numbers of `count` parts that lie evenly along the way, those that turned most in the place of repeated ones."""
    turned = np.array([
        np.abs(np.diff(part.measured[part.unscored_ticks : part.ticks, :wheels], axis=0)).sum() for part in parts
    ])
    turned = turned + 1e-9  # evenly in time where nothing turns
    at = (np.arange(count) + 0.5) / count * turned.sum()
    chosen = dict.fromkeys(np.searchsorted(np.cumsum(turned), at).tolist())
    for i in np.argsort(-turned, kind="stable").tolist():
        if len(chosen) < min(count, len(parts)):
            chosen.setdefault(i)
    return sorted(chosen)


def _parts(track: Track, settling_ticks: int) -> list[Track]:
    """Equal stretches of a track."""
    return equal_parts(track, int(np.ceil(track.ticks * TICK_S / STRETCH_S)), settling_ticks)


def equal_parts(track: Track, count: int, settling_ticks: int) -> list[Track]:
    """The track in `count` parts of the same length; settling_ticks: ticks, as `stretch` takes them."""
    edges = np.linspace(0, track.ticks, count + 1).astype(int)
    return [stretch(track, first, last, settling_ticks) for first, last in itertools.pairwise(edges.tolist())]


def stretch(track: Track, first: int, last: int, settling_ticks: int) -> Track:
    """The track between two ticks.

    It begins up to `settling_ticks` before, which are not scored: nobody knows the state of a robot that moves, and the
    filter needs that long to find it. Its first LEAD_TICKS have no fixes: a camera that is late shows what was before.
    """
    if (first, last) == (0, track.ticks):
        return track
    begin = max(first - settling_ticks, 0)
    rows = slice(begin, last + LEAD_TICKS)
    kept = (track.fix_ticks >= (begin + LEAD_TICKS if begin else 0)) & (track.fix_ticks < last)
    sightings, at = np.zeros_like(track.sightings[rows]), track.fix_rows[kept]
    sightings[at - begin] = track.sightings[at]
    inside = (track.seen[:, 0] >= begin * TICK_S) & (track.seen[:, 0] < last * TICK_S)
    reads = track.reads
    if reads is not None:
        reads = reads[(reads >= begin) & (reads < last + LEAD_TICKS)] - begin
    return replace(
        track, name=f"{track.name} from {track.since_s + first * TICK_S:.0f} s", ticks=last - begin,
        command=track.command[rows], measured=track.measured[rows], sightings=sightings,
        fix_ticks=track.fix_ticks[kept] - begin, fix_t=track.fix_t[kept] - begin * TICK_S, missed=np.empty(0),
        aim=track.aim if begin == 0 else None, force=None if track.force is None else track.force[rows],
        since_s=track.since_s + begin * TICK_S, unscored_ticks=max(first, track.unscored_ticks) - begin,
        unsure=None if track.unsure is None else track.unsure[rows],
        reads=reads, rounding=None if track.rounding is None else track.rounding[rows],
        seen=track.seen[inside] - np.array([begin * TICK_S, 0.0, 0.0, 0.0]),
    )


def begun(track: Track, wheels: int, settling_ticks: int) -> Track:
    """The track; if it begins while the robot moves, its first `settling_ticks` are not scored, or half of it at most.

    Nor has it fixes in its first LEAD_TICKS then, as a `stretch`. A wheel at rest may stand at the edge of a count:
    what it turns beyond one is looked at, for as long as the slowest motion takes for it.
    """
    slowest = _MOVING * np.sqrt(np.mean(np.diff(track.measured[: track.ticks, :wheels], axis=0) ** 2))
    first = min(max(_FIRST_TICKS, int(np.ceil(track.count_rad / slowest))), track.ticks) if slowest else _FIRST_TICKS
    turned = np.abs(track.measured[first, :wheels] - track.measured[0, :wheels]).max() - track.count_rad
    if turned <= slowest * first:
        return track
    kept, sightings = track.fix_ticks >= LEAD_TICKS, track.sightings.copy()
    sightings[track.fix_rows[~kept]] = 0.0
    return replace(
        track, unscored_ticks=min(settling_ticks, track.ticks // 2), sightings=sightings,
        fix_ticks=track.fix_ticks[kept], fix_t=track.fix_t[kept],
    )
