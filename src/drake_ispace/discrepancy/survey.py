"""All effects looked at from one point: their signatures, the noise that none of them explains, and a screen of tests."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from drake_ispace.discrepancy.candidates import Candidate, probes
from drake_ispace.discrepancy.generic import generics
from drake_ispace.discrepancy.hypothesize import Screen, Signature, signatures
from drake_ispace.discrepancy.likelihood import Likelihood, Point, merged
from drake_ispace.discrepancy.predict import Prediction, Residuals
from drake_ispace.discrepancy.whitening import Whitening


@dataclass(frozen=True)
class Survey:
    """Where a model with the effects of `point` stands.

    Attributes:
        point: effects in the model. residuals: left by it; w: the same, whitened. likelihood: with the noise of here.
        screen: tests of every candidate. noise: (rows,) what none of them explains. instants: see Whitening.
    """

    point: Point
    residuals: Residuals
    w: np.ndarray
    likelihood: Likelihood
    screen: Screen
    noise: np.ndarray
    instants: np.ndarray


def survey(
    prediction: Prediction, point: Point, tried: Sequence[Candidate], pool: ThreadPoolExecutor | None = None,
    whitening: Whitening | None = None,
) -> Survey:
    """Look around `point`. whitening: that of another point, default fitted here."""
    scales = scales_of(prediction)
    base = prediction.residuals(merged(point), pool)
    offsets = prediction.nuisances(merged(point))
    names = {c.name for c in point}
    others = [c for c in tried if c.name not in names]
    found = signatures(prediction, point, others, scales, base, pool) + generics(prediction, point, base, pool)
    if whitening is None:
        left = unexplained(base, [s.change for s in found], offsets)
        whitening = Whitening(left, prediction.classes(), len(found) + len(offsets))
    sizes = {c: _sizes(c, scales) for c in tried}
    w = whitening(base)
    tolerated = [whitening(change) for change in _tolerated(found, scales)]
    columns = np.stack([*_own_rows(whitening, base, offsets), *tolerated], axis=1) if offsets or tolerated \
        else np.empty((len(w), 0))
    likelihood = Likelihood(prediction, whitening, columns, sizes, pool)
    screen = Screen(likelihood, found)
    return Survey(point, base, w, likelihood, screen, _noise(likelihood, screen, w), whitening.instants(base))


def scales_of(prediction: Prediction) -> dict[str, float]:
    """Root mean square of commanded torque [N m] and wheel speed [rad/s] over all runs."""
    wheels = prediction.replay.body.wheels
    commands = np.concatenate([track.command[: track.ticks] for track in prediction.tracks])
    turned = [track.measured[: track.ticks, :wheels] for track in prediction.tracks]
    speeds = np.concatenate([(angle[20::20] - angle[:-20:20]) / 0.1 for angle in turned])
    return {"torque": float(np.sqrt(np.mean(commands**2))) or 1.0, "speed": float(np.sqrt(np.mean(speeds**2))) or 1.0}


def _sizes(candidate, scales):
    found = probes(candidate, scales)
    neutral = candidate.neutral
    moved = [[abs(z[i] - neutral[i]) for z in found if z[i] != neutral[i]] for i in range(len(neutral))]
    return [min(sizes) if sizes else 1.0 for sizes in moved]


def _own_rows(whitening, base, offsets):
    """Whitened residual changes of every nuisance, each zero but in its own run."""
    lengths = [len(whitening.one(i, run)) for i, run in enumerate(base)]
    starts = np.cumsum([0, *lengths])
    for i, change in offsets:
        column = np.zeros(starts[-1])
        column[starts[i] : starts[i + 1]] = whitening.one(i, change)
        yield column


def _tolerated(found, scales):
    """What each effect does to the residuals at the size that a sound robot may have."""
    changes, seen = [], set()
    for signature in found:
        candidate = signature.candidate
        at = next((i for i, z in enumerate(signature.z) if z != candidate.neutral[i]), None)
        if at is None or (candidate, at) in seen or not candidate.parameters[at].tolerance:
            continue
        seen.add((candidate, at))
        parameter = candidate.parameters[at]
        share = parameter.tolerance * scales.get(parameter.scale, 1.0) / abs(signature.z[at] - candidate.neutral[at])
        changes.append([{name: share * rows for name, rows in run.items()} for run in signature.change])
    return changes


def unexplained(
    residuals: Residuals, changes: Sequence[Residuals], offsets: Sequence[tuple[int, dict[str, np.ndarray]]],
) -> Residuals:
    """What all changes, and the offsets (run, change), together leave of the residuals, by least squares on channels of
    equal weight."""
    scale = {
        name: np.maximum(np.vstack([run[name] for run in residuals]).std(axis=0), 1e-12)
        for name in residuals[0] if any(len(run[name]) for run in residuals)
    }
    flat = lambda runs: np.concatenate([(run[s] / scale[s]).ravel() for run in runs for s in scale])  # noqa: E731
    y = flat(residuals)
    if changes or offsets:
        starts = np.cumsum([0] + [sum(run[s].size for s in scale) for run in residuals])
        columns = np.zeros((len(y), len(changes) + len(offsets)))
        for k, change in enumerate(changes):
            columns[:, k] = flat(change)
        for k, (i, change) in enumerate(offsets, len(changes)):
            columns[starts[i] : starts[i + 1], k] = flat([change])
        columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-9)
        y = y - columns @ _least_squares(columns, y)
    left, start = [], 0
    for run in residuals:
        part = {}
        for name, rows in run.items():
            if name not in scale:
                part[name] = rows
                continue
            part[name] = y[start : start + rows.size].reshape(rows.shape) * scale[name]
            start += rows.size
        left.append(part)
    return left


def _least_squares(columns, y):
    """By the normal equations, directions that nearly coincide left out; columns of unit length."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = values > 1e-9 * values[-1]
    return vectors[:, kept] @ ((vectors[:, kept].T @ (columns.T @ y)) / values[kept])


def _noise(likelihood, screen, w):
    """What no signature and no offset explains of `w`, of unit variance again."""
    columns = np.hstack([screen.columns, likelihood.offsets]) if screen.columns.size else likelihood.offsets
    if not columns.shape[1]:
        return w
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-9)
    left = w - columns @ _least_squares(columns, w)
    return left * np.sqrt(len(w) / max(len(w) - columns.shape[1], 1))
