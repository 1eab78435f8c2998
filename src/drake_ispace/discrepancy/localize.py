"""Stage 2, localise: in which channel the disagreement shows, with what it goes, and since when."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import false_discovery_control

from drake_ispace.discrepancy.explanation import Place
from drake_ispace.discrepancy.generic import Motion, motion_of
from drake_ispace.discrepancy.predict import Prediction
from drake_ispace.discrepancy.survey import Survey

_RATE = 0.05  # of false discoveries among channels and drivers
_LEAST_SHARE = 0.02
_ROWS_ALIKE = 20  # rows that count as one in a test of association


def localize(prediction: Prediction, here: Survey, better: np.ndarray) -> list[Place]:
    """Channels that carry the disagreement, the largest share first.

    Args:
        here: of the model as given. better: (rows,) whitened residuals of the best explanation under the same noise.
    """
    labels = channel_rows(prediction, here)
    gained = here.likelihood.parts(here.w) - here.likelihood.parts(better)
    total = float(gained.sum())
    if total <= 0.0:
        return []
    motions = [motion_of(prediction, track) for track in prediction.tracks]
    places, tests = [], []
    for label in dict.fromkeys(labels):
        rows = labels == label
        share = float(gained[rows].sum()) / total
        if share >= _LEAST_SHARE:
            name, p_value = _driver(prediction, here, motions, label)
            places.append((label, share, name))
            tests.append(p_value)
    if not places:
        return []
    adjusted = false_discovery_control(np.clip(tests, 1e-300, 1.0))
    found = [
        Place(label, share, driver if q < _RATE else "none of the variables tried")
        for (label, share, driver), q in zip(places, adjusted, strict=True)
    ]
    return sorted(found, key=lambda place: -place.share)


def onset(prediction: Prediction, here: Survey, better: np.ndarray) -> str:
    """Since when the disagreement is there, in words."""
    times, gained = [], here.likelihood.parts(here.w) - here.likelihood.parts(better)
    for run in here.residuals:
        for name, noise in here.likelihood.whitening.noise.items():
            rows, p = noise.rows(run[name]), run[name].shape[1]
            share = np.repeat((np.arange(rows) + 0.5) / max(rows, 1), p)
            times.append(share if name in ("motion", "room") else np.full(rows * p, np.nan))
    times = np.concatenate(times)
    known = np.isfinite(times)
    counts = np.histogram(times[known], bins=10, range=(0.0, 1.0), weights=gained[known])[0]
    if counts.sum() <= 0.0:
        return "not to be seen"
    late = np.cumsum(counts) / counts.sum()
    if late[2] < 0.05:
        return f"from about {10 * int(np.argmax(late > 0.05))} % of a run on"
    if late[2] > 0.6:
        return "mostly in the first third of a run"
    return "from the start of a run"


def channel_rows(prediction: Prediction, here: Survey) -> np.ndarray:
    """(rows,) the channel that each whitened number belongs to."""
    return np.concatenate([
        np.tile(np.array(labels_of(prediction, name), dtype=object), noise.rows(run[name]))
        for run in here.residuals for name, noise in here.likelihood.whitening.noise.items()
    ])


def labels_of(prediction: Prediction, stream: str) -> list[str]:
    """The channels of a stream, each with where it was measured in front."""
    def source(name):
        if stream == "motion":
            return "encoder" if name.startswith("wheel") else "imu"
        return "start" if stream == "start" else "kinect"

    return [f"{source(name)}: {name}" for name in prediction.channels[stream]]


def _drivers(m: Motion) -> dict[str, np.ndarray]:
    """Variable -> (rows, k) functions of it, at every tick."""
    speed = np.hypot(m.body[:, 0], m.body[:, 1])
    acceleration = np.gradient(m.body, axis=0)
    kernel = np.ones(41) / 41.0
    smooth = np.column_stack([np.convolve(column, kernel, mode="same") for column in acceleration.T])
    c, s = np.cos(m.place[:, 2]), np.sin(m.place[:, 2])
    return {
        "speed": np.column_stack([m.body, m.body * np.abs(m.body)]),
        "direction": np.tanh(m.body / (0.05 * np.maximum(np.abs(m.body).max(axis=0), 1e-9))),
        "acceleration": smooth,
        "heading": np.column_stack([c, s]),
        "place": m.place[:, :2] - m.place[:, :2].mean(axis=0),
        "time": np.column_stack([m.t - m.t.mean(), np.exp(-m.t / 5.0)]),
        "load": np.abs(m.command),
        "command": m.command,
        "distance": np.column_stack([speed, np.abs(m.body[:, 2])]),
    }


def _driver(prediction, here, motions: Sequence[Motion], label):
    """(variable that a channel's residuals go with most, p-value)."""
    values, regressors = [], {}
    stream = "motion" if label.startswith(("encoder", "imu")) else "room"
    if label in ("kinect: seen",) or label.startswith("start"):
        return "every run alike", 1e-9
    column = labels_of(prediction, stream).index(label)
    noise = here.likelihood.whitening.noise[stream]
    for i, (run, m) in enumerate(zip(here.residuals, motions, strict=True)):
        e = noise.whiten(run[stream], here.likelihood.whitening.classes[i].get(stream))[:, column]
        track = prediction.tracks[i]
        every = np.arange(track.ticks) if stream == "motion" else track.fix_ticks
        ticks = every[len(every) - len(e) :]
        values.append(e)
        for name, x in _drivers(m).items():
            regressors.setdefault(name, []).append(x[ticks])
    y = np.concatenate(values)
    best, least = "nothing", 1.0
    for name, parts in regressors.items():
        x = np.vstack(parts)
        x = x[:, x.std(axis=0) > 1e-12]
        if not x.shape[1]:
            continue
        x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-12)
        left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
        k, n = x.shape[1], max(len(y) // (_ROWS_ALIKE if stream == "motion" else 2), x.shape[1] + 2)
        ratio = (y @ y - left @ left) / k / max(left @ left / (n - k), 1e-300)
        p_value = float(f_distribution.sf(ratio, k, n - k))
        if p_value < least:
            best, least = name, p_value
    return best, least
