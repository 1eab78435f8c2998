"""How much less likely a channel's motion is under other clocks, window by window: quick, and without physics."""

import numpy as np

from drake_ispace.explain.check.compare.links import Base, Link, inside
from drake_ispace.explain.check.compare.regression import SLACK


def losses(link: Link, base: Base, since: np.ndarray, until: np.ndarray) -> np.ndarray:
    """(..., windows) losses of log likelihood, less those without any relation; NaN outside of the run.

    since, until: (..., windows) times [s] of the windows.
    """
    times = since.ravel(), until.ravel()
    x = link.predicted(*times).reshape(*since.shape, -1)
    kept = inside(base, since, until)
    y, left = np.broadcast_to(link.measured, x.shape), link.measured - x
    if link.any_share:
        y, left = _without(link.besides(*times).reshape(*x.shape, -1), kept, y, left)
    near = _near(y, link)
    loss = np.log1p((left / near) ** 2).sum(axis=-1) - np.log1p((y / near) ** 2).sum(axis=-1)
    return np.where(kept, loss, np.nan)


def _without(besides, kept, *motions):
    """Motions (..., windows, d) less what `besides` (..., windows, d, k) may have of each, by least squares."""
    z = (besides * kept[..., None, None]).reshape(*kept.shape[:-1], -1, besides.shape[-1])
    z = z / (np.sqrt((z**2).mean(axis=-2, keepdims=True)) + 1e-24)
    normal = np.swapaxes(z, -1, -2) @ z + 1e-6 * z.shape[-2] * np.eye(z.shape[-1])
    found = []
    for motion in motions:
        flat = (motion * kept[..., None]).reshape(*z.shape[:-1], 1)
        share = np.linalg.solve(normal, np.swapaxes(z, -1, -2) @ flat)
        found.append((flat - z @ share).reshape(motion.shape))
    return found


def _near(y, link):
    """(..., 1, d) residuals that count as small."""
    near = np.empty((*y.shape[:-2], 1, y.shape[-1]))
    for group in map(list, link.groups):
        size = np.sqrt((y[..., group] ** 2).sum(axis=-1).mean(axis=-1))[..., None, None]
        near[..., group] = np.hypot(SLACK * size, link.noise[group])
    return near + 1e-12
