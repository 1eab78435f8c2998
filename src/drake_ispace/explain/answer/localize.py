"""Which channels show the disagreement, with which variable it goes, and since when."""

import numpy as np
from scipy.stats import chi2

from drake_ispace.explain.answer.explanation import Place
from drake_ispace.explain.decide.decision import NEXT_TO_NOTHING
from drake_ispace.explain.decide.survey.generic import motion_of
from drake_ispace.explain.decide.survey.survey import Survey, blocks_of
from drake_ispace.explain.levels import CHANCE
from drake_ispace.explain.predict.prediction import Prediction, Residuals
from drake_ispace.explain.prove.left.drivers import drivers_of
from drake_ispace.explain.prove.left.remainder import since

_LEAST_DRIVEN = 0.3  # share that a variable must explain


def localize(prediction: Prediction, start: Survey, explained: Residuals) -> list[Place]:
    """The channels that show the disagreement, the largest share first.

    Args:
        prediction: of the training runs. start: survey of the model as given. explained: residuals of the model with
            the best explanation in it.
    """
    labels, drops = start.channels, _drops(start, explained)
    total = float(drops.sum())
    if total <= 0.0:
        return []
    motions = [motion_of(prediction, track) for track in prediction.tracks]
    drivers = {"motion": [drivers_of(m, False) for m in motions], "room": [drivers_of(m, True) for m in motions]}
    shares = {label: float(drops[labels == label].sum()) / total for label in dict.fromkeys(labels)}
    significant = [
        Place(label, share, _driver(prediction, start, drivers, label, explained))
        for label, share in shares.items() if share >= NEXT_TO_NOTHING and chi2.sf(share * total, 1) < CHANCE
    ]
    return sorted(significant, key=lambda place: -place.share)


def _drops(start, explained):
    """(rows,) drop in deviance that the explanation brings in each whitened number."""
    return start.likelihood.parts(start.w) - start.likelihood.parts(start.likelihood.whitening(explained))


def onset(start: Survey, explained: Residuals) -> str:
    """Since when the disagreement is there, in words.

    Args:
        start: survey of the model as given. explained: residuals of the model with the best explanation in it.
    """
    times, drops = [], _drops(start, explained)
    for run in start.residuals:
        for name, noise in start.likelihood.whitening.noise.items():
            rows, p = noise.rows(run[name]), run[name].shape[1]
            share = np.repeat((np.arange(rows) + 0.5) / max(rows, 1), p)
            times.append(share if name in ("motion", "room") else np.full(rows * p, np.nan))
    times = np.concatenate(times)
    known = np.isfinite(times)
    return since(times[known], drops[known]) if drops[known].sum() > 0.0 else "not to be seen"


def _driver(prediction, start, drivers: dict[str, list[dict[str, np.ndarray]]], label, explained):
    """The variable that best predicts what the explanation takes away from the residuals of a channel.

    Of what each explains (adjusted R^2) as many rows count as can be independent.

    drivers: stream -> for each run variable -> (rows, k) functions of it.
    """
    stream = "motion" if label.startswith(("encoder", "imu")) else "room"
    if label == "kinect: seen" or label.startswith("start"):
        return "every run alike"
    column = prediction.labels(stream).index(label)
    values, of_rows, regressors = [], [], {}
    whitening = start.likelihood.whitening
    classes_of = whitening.classes
    for driven, track, classes, run, after in zip(
        drivers[stream], prediction.tracks, classes_of, start.residuals, explained, strict=True
    ):
        y = (run[stream] - after[stream])[:, column]
        every = track.scored_ticks if stream == "motion" else track.fix_ticks
        scored = classes[stream] > 0 if stream in classes else np.ones(len(y), bool)
        ticks = every[len(every) - len(y) :][scored]
        values.append(y[scored])
        of_rows.append(scored)
        for name, x in driven.items():
            regressors.setdefault(name, []).append(x[ticks])
    y = np.concatenate(values)
    blocks = blocks_of(prediction, whitening, start.residuals)[whitening.of_stream(start.residuals, stream)]
    independent, explained_shares = len(np.unique(blocks)) * np.mean(np.concatenate(of_rows)), {}
    for name, parts in regressors.items():
        x = np.vstack(parts)
        x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-12)
        rest = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
        freedom = max(independent - x.shape[1], 1.0)
        explained_shares[name] = 1.0 - rest @ rest / max(y @ y, 1e-300) * independent / freedom
    best = max(explained_shares, key=explained_shares.get)
    return best if explained_shares[best] > _LEAST_DRIVEN else "none of the variables tried"
