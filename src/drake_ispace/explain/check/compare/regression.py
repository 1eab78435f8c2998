"""How well one measured motion follows another, compared over many hypotheses at once.

The model of every hypothesis is y = x (1 + S) + z f + e. S stands for physics: wheels that are a few per cent larger,
slip, a turned camera. It is a small matrix with a normal prior, and bounded. z are motions that may have any share f,
such as that of friction in a torque. e has Student's distribution, so that a stretch that does not fit does not decide.
"""

from dataclasses import dataclass

import numpy as np

#: Standard deviation and bound of S. Residuals below the former, as a share of the motion, are not told apart.
SLACK, MOST_SLACK = 0.10, 0.45
_FREEDOM = 4.0  # of Student's distribution
MOST_ROWS = 40.0  # that count as independent
_ROUNDS = 8
_AT_ONCE = 150_000  # numbers of all hypotheses that are compared together, so that they stay in the processor's cache
_TINY = np.sqrt(np.finfo(float).eps)  # share that rounding hides; precision of the prior of f beside that of the data


@dataclass(frozen=True)
class Slack:
    """What S may be on its diagonal: standard deviation, least and most. Elsewhere it is that of physics.

    besides: standard deviation of the share of every motion z, in units of y over those of z; infinite: any share.
    marker: standard deviation of what a turn, the last of three components, adds to the other two: a marker that is not
        at the middle of the robot goes along as it turns.
    """

    std: float = SLACK
    least: float = -MOST_SLACK
    most: float = MOST_SLACK
    besides: float = np.inf
    marker: float = SLACK

    @classmethod
    def of_factor(cls, times: float) -> "Slack":
        """That of a relation whose factor is known to be right up to so many times, either way, and no better."""
        return cls(times - 1.0, 1.0 / times - 1.0, times - 1.0)

    def stds(self, d: int) -> np.ndarray:
        """(d, d) of S."""
        stds = np.where(np.eye(d) > 0.0, self.std, SLACK)
        if d == 3:
            stds[:2, 2] = self.marker
        return stds

    def bounded(self, shares: np.ndarray) -> np.ndarray:
        """S (h, d, d) within its bounds."""
        d = shares.shape[1]
        most = MOST_SLACK / SLACK * self.stds(d)
        return np.where(np.eye(d) > 0.0, np.clip(shares, self.least, self.most), np.clip(shares, -most, most))


PHYSICS = Slack()
CAMERA = Slack(marker=1.0)  # a marker is about as far from the middle as the wheels, by which turns are made lengths


def scores(
    x: np.ndarray, y: np.ndarray, groups: tuple[tuple[int, ...], ...], noise: np.ndarray, z: np.ndarray | None = None,
    slack: Slack = PHYSICS,
) -> np.ndarray:
    """(h,) logarithms of likelihood of h hypotheses.

    Args:
        x, y: (h, n, d) of n windows, in units in which the d components compare; y also (1, n, d), the same for all
            hypotheses. groups: of components that share a scale. noise: (h, d) standard deviation of y that sensors
            alone make. z: (n, d, k), the same for all hypotheses, or (h, n, d, k) motions of any share. slack: of S.
    """
    _, n, d = x.shape
    numbers = n * d * (d + (0 if z is None else z.shape[-1]))
    many = max(1, _AT_ONCE // max(numbers, 1))
    return np.concatenate([
        _scores(
            x[part], y[part] if len(y) == len(x) else y, groups, noise[part], z[part] if np.ndim(z) == 4 else z, slack
        )
        for part in (slice(first, first + many) for first in range(0, len(x), many))
    ])


def _scores(x, y, groups, noise, z, slack):
    x, y = _by_component(x), _by_component(y)
    shares, residual, scale, improbable = _fitted(x, y, z, slack)
    improbable += ((shares / slack.stds(len(noise[0]))) ** 2).sum(axis=(1, 2)) / 2.0
    return _likelihood(residual, scale_of(residual, scale), y, groups, noise) - improbable


def most(y: np.ndarray, groups: tuple[tuple[int, ...], ...], noise: np.ndarray) -> np.ndarray:
    """(h,) logarithms of likelihood of hypotheses under which y differs from x by its noise.

    Arguments as of `scores`; a noise of zeros stands for exact agreement.
    """
    y = _by_component(y)
    return _likelihood(noise[..., None], noise, y, groups, noise)


def _likelihood(residual, scale, y, groups, noise):
    """(h,) logarithms of likelihood of residuals (h, d, n) of a scale (h, d), over those of y unrelated to anything."""
    size = np.empty_like(noise)
    for group in groups:
        motion = y[:, group]
        spread = scale_of(motion)
        if len(groups) > 1:  # what is zero but in a few windows, as the turns of a command, outweighs no other motion
            spread = np.maximum(spread, SLACK * np.sqrt((motion**2).mean(axis=-1)))
        size[:, group] = (spread**2).sum(axis=-1, keepdims=True)
    size = np.sqrt(size + noise**2 + 1e-24)
    ratio = np.clip(np.sqrt(scale**2 + noise**2) / size, SLACK, 1.0)
    # Student's density; what is far out counts, but as its logarithm only. What is below the noise counts as noise: a
    # reading that shrinks a channel is not the likelier for it
    left = (residual**2 + noise[..., None] ** 2) / (ratio * size)[..., None] ** 2
    far = 0.5 * (_FREEDOM + 1.0) * np.log1p(left / _FREEDOM).mean(axis=-1)
    return -min(y.shape[-1], MOST_ROWS) * (np.log(ratio) + far).sum(axis=-1)


def residuals(x: np.ndarray, y: np.ndarray, z: np.ndarray | None = None, slack: Slack = PHYSICS) -> np.ndarray:
    """(n, d) y (n, d) less what x (n, d) explains of it, physics included; z, slack: as of `scores`."""
    return _fitted(x.T[None], y.T[None], z, slack)[1][0].T


def relation(x: np.ndarray, y: np.ndarray, slack: Slack) -> np.ndarray:
    """(h, d, d) the most probable 1 + S, by which motions x (h, n, d) are multiplied to come near to y; as of `scores`.
    """
    return np.eye(x.shape[2]) + np.swapaxes(_fitted(_by_component(x), _by_component(y), None, slack)[0], 1, 2)


def _by_component(motions):
    """(h, d, n) motions (h, n, d), so that the windows of a component lie one after the other."""
    return np.ascontiguousarray(np.swapaxes(motions, 1, 2))


def _fitted(x, y, z, slack):
    """S (h, d, d) and residuals (h, d, n) at the most probable S and f, by iteratively weighted least squares.

    Also (h, d) the scale of the residuals, and (h,) how improbable f is, as a loss of log likelihood. x, y: (h, d, n);
    z: as of `scores`.
    """
    h, d, n = x.shape
    z = np.zeros((n, d, 0)) if z is None else z
    k, size = z.shape[-1], np.sqrt((z**2).mean(axis=-3) + 1e-24)
    certain = 1.0 / (slack.besides * size) ** 2
    design = np.empty((h, d, d + k, n))
    design[:, :, :d], design[:, :, d:] = x[:, None], np.moveaxis(z, -3, -1) / size[..., None]
    prior = np.zeros((*certain.shape[:-1], d + k, d + k))
    prior[..., range(d), range(d)] = 1.0 / slack.stds(d) ** 2
    prior[..., range(d, d + k), range(d, d + k)] = certain
    steady = np.diag([0.0] * d + [_TINY] * k)
    apart = residual = y - x
    of_x, of_y = (np.sqrt((motion**2).mean(axis=(1, 2)))[:, None] for motion in (x, y))
    least = np.maximum(SLACK * of_y, _TINY * of_x) + 1e-12
    scale = None
    for _ in range(_ROUNDS):
        scale = scale_of(residual, scale)
        near = np.maximum(scale, least)[..., None]
        weight = weights(residual / near) / near**2 * (min(n, MOST_ROWS) / n)
        weighted = design * weight[:, :, None]
        normal = weighted @ np.swapaxes(design, 2, 3) + prior + steady * weight.sum(axis=-1)[..., None, None]
        shares = np.linalg.solve(normal, weighted @ apart[..., None])[..., 0]
        shares[..., :d] = slack.bounded(shares[..., :d])
        residual = apart - (shares[:, :, None] @ design)[:, :, 0]
    return shares[..., :d], residual, scale, (certain * shares[..., d:] ** 2).sum(axis=(1, 2)) / 2.0


def weights(residual: np.ndarray) -> np.ndarray:
    """Weights of residuals over their scale, by which weighted least squares finds what is likeliest."""
    return (_FREEDOM + 1.0) / (_FREEDOM + residual**2)


def scale_of(values: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
    """Return the scale (...,) of Student's distribution along the last axis of values (..., n), by iteration.

    near: one that was right for values that hardly differ, of which the iteration goes on; None: it begins anew.
    """
    squares = values**2
    least = 1e-6 * squares.mean(axis=-1) + 1e-24  # most values may be zero
    scale = np.median(squares, axis=-1) / 0.55 + least if near is None else near**2  # the median of t squared
    for _ in range(_ROUNDS if near is None else 1):
        # the mean of the weights times the squares, a weight being (freedom + 1) / (freedom + squares / scale)
        bounded = squares / (_FREEDOM * scale[..., None] + squares)
        scale = (_FREEDOM + 1.0) * scale * bounded.mean(axis=-1) + least
    return np.sqrt(scale)
