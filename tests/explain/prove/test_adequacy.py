"""What an answer leaves: process noise as strong as it is, and variables that predict what is left."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.errors.free_run import PREDICTION, STEP, WHEELS, Measure, simulate, windows_of
from drake_ispace.explain.prove.errors.repeats import are_one_motion, repeated_share
from drake_ispace.explain.prove.left.adequacy import _unlike
from drake_ispace.explain.prove.left.predicted import predicted_share
from drake_ispace.explain.prove.noise.noise import FORCES, JOLTS, Spreads, process_noise, sensor_noise
from drake_ispace.explain.prove.prove import prove
from drake_ispace.scenario import load_scenario
from hidden import two_wheels
from hidden.generator import generate

RANDOM = np.random.default_rng(3)


def needed(robot, level):
    """Source -> strength of the process noise in two sound runs."""
    motions = ("square", "eight")
    runs = [generate(robot, motion, {}, 12.0, 40 + i, process_noise=level) for i, motion in enumerate(motions)]
    case = prepare(f"{robot}_multirate", runs)
    prediction = case.prediction
    windows = [windows_of(prediction, i, {}) for i in range(2)]
    simulated = [simulate(prediction, i, w, {}) for i, w in enumerate(windows)]
    spreads = Spreads(prediction, windows, [{}, {}], simulated, sensor_noise(case.scenario, prediction, 0), 0)
    return process_noise(prediction, windows[0].shortest, spreads.errors, spreads.of_sensors(), spreads.of_process())


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ["omni", "pendulum"])
@pytest.mark.parametrize("level", [0.3, 2.0])
def test_process_noise_of_a_sound_robot_is_measured_and_plausible(robot, level):
    """The generator's forces are coloured otherwise than those assumed, so that the two forms share them."""
    noise = needed(robot, level)
    each = [np.hypot(noise.needed[slow], noise.needed[fast]) for slow, fast in zip(FORCES, JOLTS, strict=True)]
    assert 0.5 * level < np.median(each) < 2.0 * level
    assert all(noise.needed[source] < noise.limits[source] for source in (*FORCES, *JOLTS))


def runs_of(slopes, noise=1.0, rows=200):
    """Runs in which an error goes with a variable, each with a slope of its own."""
    runs = []
    for slope in slopes:
        x = RANDOM.standard_normal((rows, 1))
        runs.append((x, slope * x + noise * RANDOM.standard_normal((rows, 1))))
    return runs


def test_the_share_that_a_variable_predicts_is_that_of_its_variance():
    assert predicted_share(runs_of([1.0, 1.0, 1.0])) == pytest.approx(0.5, abs=0.06)


def test_noise_is_not_predicted():
    assert predicted_share(runs_of([0.0, 0.0, 0.0])) < 0.02


def test_what_is_different_in_every_run_is_not_predicted():
    assert predicted_share(runs_of([1.0, -1.0])) < 0.0


def test_a_single_run_is_cut():
    assert predicted_share(runs_of([1.0])) == pytest.approx(0.5, abs=0.1)


def test_a_variable_that_never_changes_predicts_nothing():
    assert predicted_share([(np.zeros((50, 2)), RANDOM.standard_normal((50, 1))) for _ in range(3)]) <= 0.0


def same_motion(repeated, noise=1.0, runs=3, rows=400):
    """(speed, errors) of runs of one motion, with an error that comes again in each beside noise of its own."""
    speed, again = RANDOM.standard_normal((rows, 2)), RANDOM.standard_normal((rows, 1))
    return [(speed, repeated * again + noise * RANDOM.standard_normal((rows, 1))) for _ in range(runs)]


def test_an_error_that_comes_again_is_told_from_noise():
    share, standard_errors = repeated_share(same_motion(1.0))
    assert share == pytest.approx(1.0 / (2.0 * 1.5), abs=0.06) and standard_errors > 3.0


def test_noise_does_not_come_again():
    share, standard_errors = repeated_share(same_motion(0.0))
    assert abs(share) < 0.02 and standard_errors < 3.0


def test_runs_of_other_motions_say_nothing_of_each_other():
    one, other = same_motion(1.0)[0], same_motion(1.0)[0]
    assert repeated_share([one, (other[0], one[1])]) == (0.0, 0.0)


def test_the_opposite_does_not_count_as_again():
    (speed, errors), *_ = same_motion(1.0)
    assert repeated_share([(speed, errors), (speed, -errors)])[0] < 0.0


def test_runs_that_begin_a_little_later_repeat_one_motion():
    t = np.arange(0.0, 20.0, 0.005)
    speeds = [np.column_stack([np.sin(t - late), np.cos(t - late)]) for late in (0.0, 0.1, 0.25)]
    assert are_one_motion(speeds) and not are_one_motion(speeds[:1])
    assert not are_one_motion([*speeds, -speeds[0]])


WHEEL = [Measure(PREDICTION, "0.2s", f"encoder: wheel {i + 1}", "rad", WHEELS) for i in range(4)]


@pytest.mark.parametrize(("sensors", "chance", "said"), [
    (0.1, 0.1, True), (1.6, 0.1, False), (0.1, [0.1, 0.2, 0.1, 0.1], False),
], ids=["unlike", "sensors", "more noise"])
def test_a_wheel_is_unlike_the_others_by_more_than_sensors_and_process_noise_leave(sensors, chance, said):
    errors = RANDOM.standard_normal((2000, 4)) * [1.0, 1.8, 1.0, 1.0]
    run = {m: SimpleNamespace(errors=errors[:, [i]]) for i, m in enumerate(WHEEL)}
    floors = {m: float(np.broadcast_to(chance, 4)[i]) for i, m in enumerate(WHEEL)}
    found = _unlike([run], dict.fromkeys(WHEEL, sensors), floors)
    assert [remainder.channel for remainder in found] == (["encoder: wheel 2"] if said else [])


def test_the_place_of_a_robot_that_turns_on_the_spot_goes_with_nothing():
    """Fixes would be compared with their own errors if the way came from them; camera and wheels alone are judged."""
    on_the_spot = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "speeds_m_s": (0.0, 0.0)}
    runs = [two_wheels.drive(40 + i, 15.0, **on_the_spot) for i in range(2)]
    runs = [replace(run, channels={k: c for k, c in run.channels.items() if k != "command"}) for run in runs]
    for run in runs:
        run.channels["kinect"].values[:, :2] += 0.003 * RANDOM.standard_normal((len(run.channels["kinect"].t), 2))
    case = prepare(two_wheels.model(), runs)
    assert not [r for r in prove(case, SimpleNamespace(named=None), 0).remainders if r.driver == "place"]


def test_the_heading_of_a_robot_that_does_not_turn_goes_with_nothing():
    """Fixes would be compared with their own errors if the turn were taken from them."""
    runs = [generate("omni", "square", {}, 12.0, 66000 + i, process_noise=0.3) for i in range(3)]
    case = prepare("omni_multirate", runs)
    assert prove(case, SimpleNamespace(named=None), 0).remainders == []


def fixes_of(noise_std_pixels):
    """(errors of fixes of a robot at rest, of one that moves); the camera has whole pixels."""
    scenario = load_scenario("omni_multirate", [f"space.localizer.noise_std_pixels={noise_std_pixels}"])
    prediction = prepare(scenario, [generate("omni", "square", {}, 3.0, 1)]).prediction
    of_fixes = sensor_noise(scenario, prediction, 0).of_fixes
    moving = np.column_stack([np.linspace(0.0, 3.0, 400), np.linspace(0.0, 2.0, 400), np.linspace(0.0, 6.0, 400)])
    return of_fixes(np.zeros((400, 3)), np.random.default_rng(1)), of_fixes(moving, np.random.default_rng(1))


def test_whole_pixels_repeat_the_error_of_a_robot_at_rest():
    at_rest, moving = fixes_of(0.0)
    assert np.all(at_rest == at_rest[0]) and np.any(at_rest[0] != 0.0)
    pixel = np.array([0.00487, 0.00551])
    assert moving[:, :2].std(axis=0) == pytest.approx(pixel / np.sqrt(24.0), rel=0.2)  # the mean of two markers


def test_noise_of_the_markers_comes_on_top_of_whole_pixels():
    _, moving = fixes_of(1.0)
    assert moving[:, 0].std() == pytest.approx(0.00487 * np.sqrt((1.0 + 1.0 / 12.0) / 2.0), rel=0.15)


def test_a_model_that_runs_away_has_no_process_noise():
    robot = SimpleNamespace(driven="torque", most_slip=3.0, most_unknown=3.0)
    prediction = SimpleNamespace(replay=SimpleNamespace(body=SimpleNamespace(robot=robot)))
    shown = [Measure(PREDICTION, horizon, "encoder: wheel 1", "rad", "torque") for horizon in (STEP, "0.2s")]
    noise = [{measure: np.linspace(-1.0, 1.0, 9)[:, None] for measure in shown}]
    away = [{measure: np.full((9, 1), np.inf) for measure in shown}]
    assert process_noise(prediction, "0.2s", noise, noise, {"force 1": noise}).needed == {"force 1": 0.0}
    with pytest.raises(np.linalg.LinAlgError, match="runs away"):
        process_noise(prediction, "0.2s", away, noise, {"force 1": noise})
