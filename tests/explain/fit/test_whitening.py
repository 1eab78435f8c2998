"""Residuals become independent numbers of unit size, and slow noise is not mistaken for physics."""

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_ispace.explain.fit.directions import amounts_of, errors_of
from drake_ispace.explain.fit.whitening import Whitening, fit_noise, past


def coloured(rows, rng, memory=0.9):
    return lfilter([1.0], [1.0, -memory], rng.standard_normal((rows, 2)), axis=0)


def test_coloured_noise_becomes_white():
    runs = [coloured(4000, np.random.default_rng(i)) for i in range(3)]
    noise = fit_noise(runs, "motion", [None] * 3)
    white = noise.whiten(coloured(4000, np.random.default_rng(9)))
    assert white.std(axis=0) == pytest.approx([1.0, 1.0], abs=0.05)
    for lag in (1, 2, 5, 20):
        assert np.abs(white[lag:].T @ white[:-lag] / len(white)).max() < 0.06


def test_a_mean_of_the_past_does_not_see_the_present():
    y = np.zeros((50, 1))
    y[20] = 1.0
    columns = past(y, 2, (0.5,))
    first = np.flatnonzero(columns[:, 2])[0] + 2
    assert first == 21 and columns[first - 2, 2] == pytest.approx(0.5)


def test_whitening_is_linear():
    rng = np.random.default_rng(0)
    noise = fit_noise([coloured(3000, rng)], "motion", [None])
    a, b = coloured(500, rng), coloured(500, rng)
    assert noise.whiten(2.0 * a - b) == pytest.approx(2.0 * noise.whiten(a) - noise.whiten(b))


def test_rows_at_rest_weigh_nothing():
    rng = np.random.default_rng(0)
    y, classes = coloured(3000, rng), np.full(3000, 5)
    classes[1000:1500] = 0
    white = fit_noise([y], "motion", [classes]).whiten(y, classes)
    assert np.all(white[1000 - 8 + 8 : 1492] == 0.0) and white[:900].std() == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("share", [0.5, 0.05])
def test_rows_that_move_have_unit_size_however_few_they_are(share):
    rng, classes = np.random.default_rng(0), np.zeros(20000, int)
    classes[-round(share * len(classes)) :] = 1
    y = rng.standard_normal((len(classes), 2))
    white = fit_noise([y], "motion", [classes]).whiten(y, classes)
    assert white[white.any(axis=1)].std() == pytest.approx(1.0, abs=0.06)


def test_noise_that_is_larger_in_a_class_of_motion_is_scaled_there():
    rng, classes = np.random.default_rng(0), np.repeat([1, 2, 3], 2000)
    y = rng.standard_normal((6000, 2)) * np.repeat([1.0, 3.0, 1e-3], 2000)[:, None]
    noise = fit_noise([y], "motion", [classes])
    overall = np.sqrt((1.0 + 9.0) / 3.0)
    assert noise.sizes[1:3, 0] == pytest.approx([1.0 / overall, 3.0 / overall], rel=0.05)
    assert noise.sizes[3] == pytest.approx(0.1)  # quantised numbers may be still for long


def test_a_class_with_few_rows_has_the_noise_of_all():
    rng, classes = np.random.default_rng(0), np.full(3000, 1)
    classes[:50] = 2
    noise = fit_noise([rng.standard_normal((3000, 2))], "motion", [classes])
    assert np.all(noise.sizes[2] == 1.0)


def test_rows_that_are_independent_have_their_spread_and_no_memory():
    rows = np.random.default_rng(0).standard_normal((500, 3)) * [0.02, 0.02, 0.001]
    noise = fit_noise([rows], "start", [None])
    assert noise.lags == 0 and noise.unit.diagonal() == pytest.approx([50.0, 50.0, 1.0 / 0.026], rel=0.1)
    few = fit_noise([np.ones((1, 3))], "start", [None])
    assert few.unit.diagonal() == pytest.approx([1.0 / 0.006, 1.0 / 0.006, 1.0 / 0.026])


def test_a_run_that_is_shorter_than_the_memory_gives_no_rows():
    noise = fit_noise([coloured(3000, np.random.default_rng(0))], "motion", [None])
    short = np.ones((3, 2))
    assert noise.rows(short) == 0 and noise.whiten(short).shape == (0, 2)


@pytest.mark.parametrize("rows, spent, freedom", [(20, 0, 20.0), (20, 8, 16.0), (20, 100, 10.0), (1, 0, 1.0)])
def test_what_was_fitted_before_is_missing_in_the_number_of_rows(rows, spent, freedom):
    y = np.random.default_rng(0).standard_normal((rows, 2))
    unit = fit_noise([y], "motion", [None], spent).unit
    assert np.linalg.inv(unit.T @ unit)[0, 0] == pytest.approx((y.T @ y / freedom)[0, 0], rel=1e-3)


def test_slow_noise_that_was_taken_away_counts_as_noise():
    y = coloured(4000, np.random.default_rng(3), 0.97)
    waves = np.cos(np.pi * np.outer(np.arange(1, 60), np.arange(4000) + 0.5) / 4000)
    changes = [wave[:, None] * axis for wave in waves for axis in np.eye(2)]

    def regressed(noise):
        """Amounts of the waves, gram, and the mean square of the part of whitened y that the waves explain."""
        whitened = np.array([noise.whiten(change).ravel() for change in changes])
        gram, products = whitened @ whitened.T, whitened @ noise.whiten(y).ravel()
        amounts = amounts_of(gram, products)
        return amounts, gram, amounts @ products / len(changes)

    amounts, gram, usual = regressed(fit_noise([y], "motion", [None]))
    left = y - np.tensordot(amounts, changes, axes=1)
    errors = [[np.tensordot(error, changes, axes=1)] for error in errors_of(gram, 4)]
    assert regressed(fit_noise([left], "motion", [None]))[2] > 2.0 * usual
    assert regressed(fit_noise([left], "motion", [None], errors=errors))[2] == pytest.approx(usual, rel=0.2)


def test_a_short_run_is_whitened_with_a_short_memory():
    assert fit_noise([coloured(100, np.random.default_rng(0))], "motion", [None]).lags == 1
    assert fit_noise([coloured(20, np.random.default_rng(0))], "motion", [None]).lags == 0


def test_rows_of_one_instant_keep_together():
    runs = [{"motion": coloured(1000, np.random.default_rng(i))} for i in range(2)]
    whitening = Whitening(runs, [{}, {}])
    instants = whitening.instants(runs)
    assert len(instants) == len(whitening(runs)) and np.all(np.diff(instants) >= 0)
    assert np.all(np.bincount(instants) == 2)
    together = whitening.instants(runs, {"motion": 200})
    assert together[-1] + 1 == 2 * int(np.ceil((1000 - whitening.noise["motion"].lags) / 200))


def test_numbers_as_they_were_stand_where_the_whitened_ones_do():
    y, classes = coloured(1000, np.random.default_rng(0)), np.full(1000, 5)
    classes[300:400] = 0
    whitening = Whitening([{"motion": y}], [{"motion": classes}])
    plain, lags = whitening.plain([{"motion": y}]).reshape(-1, 2), whitening.noise["motion"].lags
    assert plain.size == len(whitening([{"motion": y}]))
    at_rest = classes[lags:] == 0
    assert np.isnan(plain[at_rest]).all() and plain[~at_rest] == pytest.approx(y[lags:][~at_rest])


def test_the_memory_lasts_as_long_in_time_however_often_the_motion_is_measured():
    rows = coloured(3000, np.random.default_rng(0))
    often, rarely = fit_noise([rows], "motion", [None]).means, fit_noise([rows], "motion", [None], ticks=4).means
    assert [(1.0 - rate) ** 4 for rate in often] == pytest.approx([1.0 - rate for rate in rarely])


def two_noises(seed):
    """Residuals of a run with two streams, and the noise of others, with classes of its own."""
    random = np.random.default_rng(seed)
    classes = [{"motion": random.integers(0, 3, 300)}]
    learned = [{"motion": coloured(300, random, 0.5) * (1.0 + 3.0 * (classes[0]["motion"][:, None] == 2)),
                "room": random.standard_normal((80, 3))}]
    return learned, Whitening(learned, classes)


def test_a_log_volume_makes_sums_of_squares_under_several_noises_comparable():
    """With it they are -2 log of a density, whose Jacobian is that of the whitening."""
    residuals, whitening = two_noises(1)
    rows, p = residuals[0]["motion"].shape
    lags, scored = whitening.noise["motion"].lags, np.repeat(whitening.classes[0]["motion"], p) > 0
    columns = []
    for at in range(rows * p):
        y = np.zeros(rows * p)
        y[at] = 1.0
        columns.append(whitening.one(0, {"motion": y.reshape(rows, p), "room": 0.0 * residuals[0]["room"]}))
    motion = np.array(columns).T[: (rows - lags) * p, lags * p :]
    kept = scored[lags * p :]
    room = whitening.noise["room"]
    of_room = -2.0 * room.rows(residuals[0]["room"]) * np.linalg.slogdet(room.unit)[1]
    volume = of_room - 2.0 * np.linalg.slogdet(motion[np.ix_(kept, kept)])[1]
    assert whitening.log_volume(residuals) == pytest.approx(volume)


def test_two_noises_can_be_made_to_score_the_same_rows():
    (residuals, one), (_, other) = two_noises(1), two_noises(2)
    both = [one.scoring_as(other), other.scoring_as(one)]
    (first, second) = (np.isnan(noise.plain(residuals)) for noise in both)
    assert first.tolist() == second.tolist() and first.sum() > np.isnan(one.plain(residuals)).sum()
