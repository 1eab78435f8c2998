"""The error that every fix has by itself is told from what goes on from fix to fix."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.prove.errors.free_run import ATE, RPE, RUN, WHEELS, Measure
from drake_ispace.explain.prove.errors.paths import chained, pairs, relative_errors
from drake_ispace.explain.prove.left.adequacy import too_large
from drake_ispace.explain.prove.noise.fix_noise import at_rest, error_of_each_fix, left_by_fixes, on_the_move
from drake_ispace.plants.wheels import differential

STEP_S, ROWS, WAY_M, TURN_RAD = 0.1, 4000, 0.03, 0.02
STD = np.array([0.004, 0.006, 0.02])


def driven(seed=0, scale=1.0, slip=0.0):
    """(ROWS, 3) poses on an arc; a wrong scale, or slip (standard deviation of each step), lets the path go astray."""
    steps = np.tile([scale * WAY_M, 0.0, TURN_RAD], (ROWS - 1, 1))
    return chained(np.zeros(3), steps + slip * np.random.default_rng(seed).standard_normal(steps.shape))


def seen(poses, std, seed=1):
    """Fixes of these poses."""
    return poses + std * np.random.default_rng(seed).standard_normal(poses.shape)


def test_it_is_the_noise_of_the_fixes():
    assert error_of_each_fix([(driven(), seen(driven(), STD))] * 2) == pytest.approx(STD, rel=0.1)


@pytest.mark.parametrize("off", [{"scale": 1.05}, {"slip": 0.003}])
def test_a_path_that_goes_astray_is_no_error_of_the_fixes(off):
    assert np.all(error_of_each_fix([(driven(**off), driven())]) < [6e-4, 6e-4, 6e-4])


def test_a_few_steps_of_the_place_are_no_error_of_every_fix():
    fixes = seen(driven(), 0.1 * STD)
    fixes[::400, 0] += 0.5
    assert error_of_each_fix([(driven(), fixes)]) == pytest.approx(0.1 * STD, rel=0.3)


def test_it_makes_the_relative_errors_of_a_noisy_camera():
    fixes, t = seen(driven(), STD), STEP_S * np.arange(ROWS)
    left = left_by_fixes(STD, [(t, fixes)])
    for horizon in (1.0, 5.0):
        a, b = pairs(t, horizon, 0.0).T
        off = relative_errors((driven()[a], driven()[b]), (fixes[a], fixes[b]))
        x, y, heading = np.sqrt(np.mean(off**2, axis=0))
        assert left[f"{horizon:g}s", "position"] == pytest.approx(np.hypot(x, y), rel=0.1)
        assert left[f"{horizon:g}s", "heading"] == pytest.approx(heading, rel=0.1)


@pytest.mark.parametrize("metric, horizon", [(RPE, "1s"), (ATE, RUN)])
@pytest.mark.parametrize("own, said", [(0.9, True), (0.5, False)])
def test_it_is_said_where_it_is_most_of_what_is_left(metric, horizon, own, said):
    measure, error = Measure(metric, horizon, "position", "m", WHEELS), np.full((50, 2), 1.0 / np.sqrt(2.0))
    (left,) = too_large([{measure: error}], {measure: 0.1}, {}, ["run"], {(horizon, "position"): own})
    assert ("every fix by itself" in left.because) == said


@pytest.mark.parametrize("windows, said", [(5, False), (500, True)])
def test_few_windows_may_be_large_by_chance(windows, said):
    measure = Measure(RPE, "1s", "heading", "rad", WHEELS)
    assert bool(too_large([{measure: np.full((windows, 1), 1.8)}], {measure: 1.0}, {}, ["run"])) == said


WHEELS_OF = differential(0.05, 0.15)
STATED = np.array([0.012, 0.012, 0.05])


def recorded(std, pixel_m=0.0, rests=False, told=(1.0, 1.0)):
    """A Track on an arc, or at rest, with a fix every 20 ticks, of coordinates in whole pixels (0: none).

    told: shares of the way and of the turn that the wheels tell.
    """
    each = 20
    steps = np.zeros((ROWS * each, 3)) if rests else np.tile([WAY_M / each, 0.0, TURN_RAD / each], (ROWS * each, 1))
    wheels = (steps * [told[0], 1.0, told[1]]) @ WHEELS_OF.inverse.T
    turned = np.vstack([np.zeros(2), np.cumsum(wheels, axis=0)])
    fixes = seen(chained(np.zeros(3), steps)[: ROWS * each : each], std)
    if pixel_m:
        fixes[:, :2] = pixel_m * np.round(fixes[:, :2] / pixel_m)
    at = 0.005 * each * np.arange(ROWS)
    return SimpleNamespace(
        has={"encoder", "kinect"}, turned=turned, measured=turned, ticks=len(steps) - 1,
        seen=np.column_stack([at, fixes]),
    )


@pytest.mark.parametrize("told", [(1.0, 1.0), (1.3, 1.0), (1.0, 0.7)])
def test_fixes_on_the_move_show_how_noisy_they_are_at_most(told):
    most = on_the_move([recorded(STD, told=told)], WHEELS_OF, STATED)
    assert np.all(most > 0.98 * STD) and np.all(most < 1.2 * STD)


def test_whole_pixels_on_the_move_say_nothing_nor_do_four_fixes():
    assert np.all(np.isinf(on_the_move([recorded(0.0 * STD, 0.01)], WHEELS_OF, STATED)))
    few = recorded(STD)
    few.seen = few.seen[:4]
    assert np.all(np.isinf(on_the_move([few], WHEELS_OF, STATED)))


def test_few_fixes_on_the_move_say_little():
    few = recorded(STD)
    few.seen = few.seen[:8]
    assert np.all(on_the_move([few], WHEELS_OF, STATED) > 1.2 * STD)


def test_a_robot_at_rest_shows_the_noise_of_its_fixes_unless_they_are_whole_pixels():
    least, likely, most = at_rest([recorded(STD, rests=True)], 2)
    assert np.all(least < likely) and np.all(least > 0.7 * STD)
    assert likely == pytest.approx(STD, rel=0.05) and np.all(likely < most) and np.all(most < 1.05 * likely)
    assert at_rest([recorded(0.0 * STD, 0.01, rests=True)], 2) is None
    assert at_rest([recorded(STD)], 2) is None


@pytest.mark.parametrize("seed", range(20))
def test_few_fixes_at_rest_say_less(seed):
    few = recorded(STD, rests=True)
    few.seen = np.column_stack([few.seen[:14, 0], seen(np.zeros((14, 3)), STD, seed)])
    least, likely, most = at_rest([few], 2)
    assert np.all(most > STD) and np.all(likely < 1.9 * STD) and np.all(least < STD)


def test_a_heading_that_comes_again_at_rest_says_nothing():
    few = recorded(STD, rests=True)
    few.seen = few.seen[:8].copy()
    few.seen[:, 3] = 0.5
    assert at_rest([few], 2) is None


def test_fixes_at_rest_that_were_mistaken_have_no_part_in_the_noise():
    sound = recorded(STD, rests=True)
    mistaken = recorded(STD, rests=True)
    mistaken.seen[::40, 1:] += [0.5, -1.0, 0.7]
    _, likely, _ = at_rest([mistaken], 2)
    assert likely == pytest.approx(at_rest([sound], 2)[1], rel=0.03)


def test_of_a_place_that_one_run_alone_has_the_error_is_that_runs():
    measure = Measure(RPE, "1s", "position", "m", WHEELS)
    (left,) = too_large([{}, {measure: np.full((50, 1), 9.0)}], {measure: 0.1}, {}, ["blind", "seen"])
    assert left.runs == ["seen"]
