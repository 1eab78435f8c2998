"""Errors of free-run simulations of a user's own plant, over whole runs and over single seconds, and what chance makes.

What unknown torques do adds up: at the end of a run chance alone may lead as far away as whatever is missing, and then
the run tells nothing, but each of its seconds does, from the angles and rates with which it comes nearest. A plant
whose state is more than these is known only where a run begins, and is simulated over whole runs alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.decide.proposals.detect import FALSE_ALARM_RATE
from drake_ispace.explain.fit.free_run import Sizes, channel_of, errors, errors_from_nearest, measured, unit_of
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.predict.own_replay import OwnReplay
from drake_ispace.explain.predict.stretches import equal_parts
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.prove.errors.free_run import ATE, RUN, SPACING_S, Errors, Measure, horizon_of, rms
from drake_ispace.explain.threads import each

_Noise = Mapping[Measure, float]


def errors_of_runs(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> list[Errors]:
    """Errors of each run, in the unit of what was logged, and whole runs as a share of its root mean square as well."""
    size = max(rms([measured(replay, track) for track in tracks]), 1e-300)
    found = []
    for track in tracks:
        run = {
            _measure(replay, horizon): np.vstack([_errors(replay, part, sizes, horizon) for part in parts])
            for horizon, parts in _parts(replay, track).items()
        }
        found.append({**run, _relative(replay): run[_measure(replay, RUN)] / size})
    return found


def noise_of_runs(
    replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes, after: Sequence[Errors], seed: int, draws: int
) -> tuple[_Noise, _Noise, _Noise]:
    """Errors that the encoder's noise, and unknown torques as strong as the model assumes, cause by themselves.

    Both are root mean squares; a third one is exceeded by these torques as rarely as a false alarm may be.

    after: errors of each run. draws: how often torques are drawn for each whole run. For each second they are drawn so
        many times less as a run has seconds, so that both take about as long.
    """
    std = replay.angle_std * (1.0 if replay.logged == "angle" else np.sqrt(2.0) / (2.0 * TICK_S))
    sensors, chance, most = {}, {}, {}
    for horizon in dict.fromkeys(horizon for track in tracks for horizon in _parts(replay, track)):
        m = _measure(replay, horizon)
        sensors[m] = float(std)
        chance[m], most[m] = _by_chance(replay, tracks, sizes, horizon, seed, draws)
    whole, relative = _measure(replay, RUN), _relative(replay)
    size = rms([run[whole] for run in after]) / max(rms([run[relative] for run in after]), 1e-300)
    for noise in (sensors, chance, most):
        noise[relative] = noise[whole] / size
    return sensors, chance, most


def _by_chance(replay, tracks, sizes, horizon, seed, draws) -> tuple[float, float]:
    """Root mean square of what unknown torques do over a horizon, and what they hardly ever exceed."""
    parts = [part for track in tracks for part in _parts(replay, track).get(horizon, [])]
    as_given = each(lambda part: _errors(replay, part, sizes, horizon), parts)

    def drawn(draw):
        """Mean squares (parts,)."""
        pushed = [replay.disturbed(part, [seed, 4, i, draw]) for i, part in enumerate(parts)]
        moved = [_errors(replay, part, sizes, horizon) for part in pushed]
        return [np.mean((after - before) ** 2) for after, before in zip(moved, as_given, strict=True)]

    draws = draws if horizon == RUN else -(-draws * len(tracks) // len(parts))
    rows = [len(part) for part in as_given]
    squares = np.array(each(drawn, range(draws))) @ rows / sum(rows)
    chance = float(np.mean(squares))
    freedom = 2.0 * chance**2 / max(float(np.var(squares)), 1e-300)  # of a chi square with their mean and variance
    return np.sqrt(chance), np.sqrt(chance * chi2.isf(FALSE_ALARM_RATE, freedom) / freedom) if chance else 0.0


def _errors(replay, track, sizes, horizon):
    """(k, 1) errors of a run or of a part of it."""
    if horizon == RUN:
        return errors(replay, track, merged(sizes.point), sizes.plant).reshape(-1, 1)
    return errors_from_nearest(replay, track, sizes).reshape(-1, 1)


def _parts(replay, track) -> dict[str, list[Track]]:
    """Horizon -> the parts of a run that last as long."""
    parts, seconds = {RUN: [track]}, round(track.ticks * TICK_S / SPACING_S)
    if replay.body.plant.load is not None and seconds > 1:
        begun = equal_parts(track, seconds, 1)
        parts[horizon_of(SPACING_S)] = [replace(part, unscored_ticks=max(part.unscored_ticks, 1)) for part in begun]
    return parts


def _measure(replay, horizon):
    return Measure(ATE, horizon, channel_of(replay), unit_of(replay), "torque")


def _relative(replay):
    return replace(_measure(replay, RUN), channel=f"{channel_of(replay)}, relative", unit="1")
