"""Metrics of made-up runs whose numbers can be checked by hand, and the comparison on one reference."""

import dataclasses
import json

import numpy as np
import pytest

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.comparison import compare, on_one_reference
from drake_ispace.control.guide.paths import Trajectory, build_path
from drake_ispace.metrics import measure
from drake_ispace.robots.omni import OmniSettings
from drake_ispace.scenario import Scenario, load_scenario
from drake_ispace.simulation import Run

SECONDS = 20.0


def at(path, arcs):
    """Points (n, 2) on a path at arc lengths (n,)."""
    arcs = arcs % path.length_m if path.closed else np.clip(arcs, 0.0, path.length_m)
    return np.column_stack([np.interp(arcs, path.table[:, 0], path.table[:, i]) for i in (1, 2)])


def made_up(trajectory, position, torque=0.0, phi=0.0, seconds=SECONDS, diverged_s=None):
    """A run of the omni robot on `trajectory`: `position` of (time, way point (n, 2)) is where the robot is (n, 2)."""
    time = np.arange(round(seconds / TICK_S) + 1) * TICK_S
    path = build_path(trajectory, "test")
    way_point = np.zeros((len(time), 10))
    if path.length_m == 0.0:
        way_point[:, 1:3] = np.where((time >= trajectory.start_s)[:, None], path.points_m[0], 0.0)
    else:
        end = path.length_m * (trajectory.laps if path.closed else 1)
        arcs = np.clip(trajectory.speed_m_s * (time - trajectory.start_s), 0.0, end)
        way_point[:, 1:3] = np.where((arcs >= end)[:, None], path.points_m[-1], at(path, arcs))
        way_point[(arcs > 0.0) & (arcs < end), 4] = trajectory.speed_m_s
    pose = np.column_stack([position(time, way_point[:, 1:3]), np.full(len(time), phi)])
    signals = {"omni_pose": pose, "omni_way_point": way_point, "omni_torque": np.full((len(time), 4), torque)}
    return Run(Scenario(omni=OmniSettings(trajectory=trajectory)), signals, diverged_s, 1.0)


def metrics(*arguments, **keywords):
    return measure(made_up(*arguments, **keywords), "omni")


def step_to(values):
    """A robot on the x axis at `values` of time (n,)."""
    return lambda time, way_point: np.column_stack([values(time), np.zeros(len(time))])


STEP = Trajectory(kind="step", goal_m=[2.0, 0.0], start_s=1.0)
LINE = Trajectory(kind="line", goal_m=[1.0, 0.0], start_s=0.0, speed_m_s=0.1)
SQUARE = Trajectory(kind="square", side_m=0.5, start_s=0.0, speed_m_s=0.2)


# ------------------------------------------------------------------------------------------------------------ a step


def test_a_robot_that_is_there_at_once_has_no_error():
    found = metrics(STEP, lambda time, way_point: way_point)
    assert (found.rms_position_error_m, found.max_position_error_m, found.iae_m_s) == (0.0, 0.0, 0.0)
    assert (found.overshoot_percent, found.settling_time_s, found.final_error_m) == (0.0, 0.0, 0.0)
    assert found.mean_lag_m is None and not found.diverged


def test_overshoot_is_in_percent_of_the_step():
    found = metrics(STEP, step_to(lambda time: np.where(time < 1.0, 0.0, np.where(time < 3.0, 2.3, 2.0))))
    assert found.overshoot_percent == pytest.approx(15.0)


def test_a_robot_that_stays_short_does_not_overshoot():
    assert metrics(STEP, step_to(lambda time: 0.9 * 2.0 * (time > 2.0))).overshoot_percent == 0.0


def test_settled_is_within_two_percent_for_good():
    found = metrics(STEP, step_to(lambda time: 2.0 - 2.0 * np.exp(-np.maximum(time - 1.0, 0.0))))
    assert found.settling_time_s == pytest.approx(np.log(50.0), abs=2 * TICK_S)


def test_a_late_excursion_counts_for_the_settling_time():
    found = metrics(STEP, step_to(lambda time: np.where(time < 1.0, 0.0, np.where(abs(time - 9.0) < 1.0, 1.9, 2.0))))
    assert found.settling_time_s == pytest.approx(9.0, abs=2 * TICK_S)


def test_a_robot_that_never_settles_has_no_settling_time():
    found = metrics(STEP, step_to(lambda time: 2.0 + 0.1 * np.sin(time)))
    assert found.settling_time_s is None and found.final_error_m == pytest.approx(0.1 * abs(np.sin(SECONDS)), abs=1e-3)


def test_the_time_to_the_end_is_that_of_the_first_visit():
    found = metrics(STEP, step_to(lambda time: 0.5 * np.maximum(time - 1.0, 0.0)))
    assert found.time_to_end_s == pytest.approx((2.0 - 0.02) / 0.5, abs=2 * TICK_S)


def test_iae_of_an_exponential_is_step_times_time_constant():
    found = metrics(STEP, step_to(lambda time: 2.0 - 2.0 * np.exp(-np.maximum(time - 1.0, 0.0) / 0.7)))
    assert found.iae_m_s == pytest.approx(2.0 * 0.7, rel=0.01)


def test_cross_track_of_a_step_is_the_distance_to_the_straight_line():
    found = metrics(STEP, lambda time, way_point: way_point + np.where(time < 0.9999, 0.0, 0.3)[:, None] * [0.0, 1.0])
    assert found.rms_cross_track_m == pytest.approx(0.3) and found.max_position_error_m == pytest.approx(0.3)


def test_the_row_before_the_first_way_point_is_no_error():
    run = made_up(dataclasses.replace(LINE, start_s=0.0), lambda time, way_point: way_point)
    run.signals["omni_way_point"][0] = [-1.0, *np.full(9, 7.0)]
    assert measure(run, "omni").max_position_error_m == 0.0


def test_a_run_lost_before_its_way_point_starts_has_no_numbers_but_the_loss():
    run = made_up(dataclasses.replace(STEP, start_s=50.0), lambda time, way_point: way_point, diverged_s=0.5)
    found = measure(run, "omni")
    assert found.diverged and found.diverged_at_s == 0.5
    assert found.rms_position_error_m is None and found.iae_m_s is None


def test_a_step_of_no_length_has_neither_overshoot_nor_division_by_zero():
    found = metrics(dataclasses.replace(STEP, goal_m=[0.0, 0.0]), lambda time, way_point: way_point)
    assert found.overshoot_percent is None and found.rms_cross_track_m == 0.0


# --------------------------------------------------------------------------------------------------------- along a path


def test_a_robot_that_lags_on_a_line_has_that_lag_and_is_on_the_track():
    found = metrics(LINE, lambda time, way_point: at(build_path(LINE, "test"), 0.1 * time - 0.08))
    assert found.mean_lag_m == pytest.approx(0.08, abs=0.01) and found.rms_cross_track_m == 0.0
    assert found.max_position_error_m == pytest.approx(0.08)


def test_a_robot_ahead_of_the_way_point_has_a_negative_lag():
    long = dataclasses.replace(LINE, goal_m=[1.0, 0.0], speed_m_s=0.04)
    found = metrics(long, lambda time, way_point: at(build_path(long, "test"), 0.04 * time + 0.05))
    assert found.mean_lag_m == pytest.approx(-0.05, abs=0.002)


@pytest.mark.parametrize("laps", [1, 2])
def test_the_lag_on_a_square_is_measured_round_its_corners(laps):
    square = dataclasses.replace(SQUARE, laps=laps)
    path = build_path(square, "test")
    found = metrics(square, lambda time, way_point: at(path, np.maximum(0.2 * time - 0.1, 0.0)), seconds=9.9 * laps)
    assert found.mean_lag_m == pytest.approx(0.1, abs=0.003) and found.rms_cross_track_m == pytest.approx(0.0, abs=1e-9)
    assert found.max_position_error_m == pytest.approx(0.1, abs=1e-3)


def test_the_lag_on_a_figure_eight_survives_its_crossing():
    eight = Trajectory(kind="figure_eight", radius_m=0.3, start_s=0.0, speed_m_s=0.3, laps=3)
    path = build_path(eight, "test")
    found = metrics(eight, lambda time, way_point: at(path, np.maximum(0.3 * time - 0.05, 0.0)), seconds=15.0)
    assert found.mean_lag_m == pytest.approx(0.05, abs=0.002)


def test_cross_track_is_the_distance_to_the_path_whatever_the_way_point_does():
    found = metrics(LINE, lambda time, way_point: np.tile([0.5, 0.12], (len(time), 1)))
    assert found.rms_cross_track_m == pytest.approx(0.12)


def test_the_end_of_a_path_is_reached_within_20_mm():
    found = metrics(LINE, lambda time, way_point: at(build_path(LINE, "test"), 0.1 * (time - 2.0)))
    assert found.time_to_end_s == pytest.approx(2.0 + 0.98 / 0.1, abs=2 * TICK_S)
    assert found.settling_time_s == pytest.approx(1.8, abs=2 * TICK_S)


def test_the_start_of_a_closed_path_is_not_its_end():
    late = dataclasses.replace(SQUARE, start_s=2.0)
    found = metrics(late, lambda time, way_point: way_point)
    assert found.time_to_end_s == pytest.approx(4 * 0.5 / 0.2, abs=2 * TICK_S)


def test_a_path_without_end_has_no_time_to_it():
    found = metrics(dataclasses.replace(SQUARE, laps=10**6), lambda time, way_point: way_point)
    assert found.time_to_end_s is None and found.settling_time_s is None


def test_what_happens_before_the_start_does_not_count():
    late = dataclasses.replace(LINE, start_s=5.0)
    found = metrics(late, lambda time, way_point: way_point + np.where(time < 4.9, 1.0, 0.0)[:, None])
    assert found.max_position_error_m == 0.0


def test_a_run_that_ends_before_the_start_still_has_numbers():
    found = metrics(LINE, lambda time, way_point: way_point, seconds=0.0)
    assert found.rms_position_error_m == 0.0


@pytest.mark.parametrize("phi, error", [(0.3, 0.3), (2.0 * np.pi + 0.3, 0.3), (-np.pi, np.pi)])
def test_heading_errors_are_taken_the_short_way(phi, error):
    assert metrics(LINE, lambda time, way_point: way_point, phi=phi).rms_heading_error_rad == pytest.approx(error)


def test_control_effort_is_the_integral_of_the_squared_torques():
    assert metrics(LINE, lambda time, way_point: way_point, torque=0.5).control_effort == pytest.approx(
        4 * 0.25 * SECONDS, rel=1e-3
    )


def test_an_endless_number_becomes_null_in_json():
    data = metrics(LINE, lambda time, way_point: way_point, torque=np.inf, diverged_s=1.5).to_data()
    assert json.loads(json.dumps(data, allow_nan=False))["control_effort"] is None
    assert data["diverged"] is True and data["diverged_at_s"] == 1.5


# --------------------------------------------------------------------------------------------------------- comparison


def test_all_runs_get_the_reference_room_and_seed_of_the_first_and_keep_their_heading():
    first = load_scenario("omni_multirate", ["omni.trajectory.kind=circle", "seed=7", "seconds=2", "space.width_m=3"])
    second = load_scenario("pendulum_multirate", ["omni.plant.mass_kg=9"])
    _, same = on_one_reference([first, second])
    assert (same.seed, same.seconds, same.space) == (7, 2.0, first.space)
    assert same.pendulum.trajectory == dataclasses.replace(first.omni.trajectory, heading="tangent")
    assert same.diagram == "pendulum_multirate" and same.omni.plant.mass_kg == 9.0


def test_two_robots_in_one_room_keep_their_own_paths():
    first = load_scenario("omni_multirate", ["omni.trajectory.kind=circle"])
    _, same = on_one_reference([first, load_scenario("shared_space")])
    assert same.pendulum.trajectory == load_scenario("shared_space").pendulum.trajectory


def test_a_comparison_alone_is_a_simulation():
    told = []
    scenario = load_scenario("omni_multirate", ["seconds=1"])
    results = compare({"mine": scenario}, lambda name, time_s: told.append((name, time_s)))
    ((name, (run, robot, found)),) = results.items()
    assert (name, robot) == ("mine", "omni") and found == measure(run, "omni")
    assert told and told[-1] == ("mine", pytest.approx(1.0))
