"""Effects between a commanded body velocity and the robot."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import arguments
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import Body
from drake_ispace.effects.library import library
from drake_ispace.effects.places.velocity import EFFECTS
from drake_ispace.effects.places.wheel_speed import beyond_dead_zone, wheels_limited
from drake_ispace.plants.rover import RoverPlantParameters
from drake_ispace.robots.library import robots
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import load_scenario

BODY = Body(robots()["rover"], RoverPlantParameters(), 3)
NAMES = [effect.card.name for effect in EFFECTS]
RAMP = np.outer(np.arange(1.0, 6.0), [1.0, 10.0, 100.0])  # commanded in ticks 0 to 4
SOME = {
    "velocity_delay": {"delay_s": 0.012}, "velocity_saturation": {"limit_m_s": 0.2, "limit_rad_s": 0.3},
    "velocity_gain": {"share_x": 0.1, "share_y": -0.1, "share_yaw": 0.2},
    "velocity_slew_limit": {"limit_m_s2": 0.4, "limit_rad_s2": 2.0},
    "velocity_braking_limit": {"limit_m_s2": 0.3, "limit_rad_s2": 1.5}, "velocity_dead_zone": {"width_rad_s": 0.4},
    "wheel_speed_limit": {"limit_rad_s": 3.0}, "wheel_speed_desaturation": {"limit_rad_s": 4.0},
    "velocity_overshoot": {"time_constant_s": 0.04, "damping": 0.3},
    "velocity_coupling": {"yaw_per_x": 0.3, "yaw_per_y": -0.2},
    "velocity_lag": {"time_constant_s": 0.05, "turning_extra_s": -0.02},
}


def through(name, velocities, **values):
    """What the effect's kernels make of velocities (n, 3), each held for a tick."""
    effect = library()[name]
    spec = effect.spec(BODY, effect.neutral(BODY) | values)
    state, rows = np.zeros(0) if spec.discrete_state is None else spec.discrete_state, []

    def call(kernel, velocity, size):
        known = {"xd": state, "velocity": velocity, **spec.parameters}
        out = np.empty(size)
        kernel(*[known[argument] for argument in arguments(kernel)], out)
        return out

    for velocity in np.atleast_2d(np.asarray(velocities, dtype=float)):
        rows.append(call(spec.outputs["velocity"].kernel, velocity, 3))
        for update in spec.updates:
            state = call(update.kernel, velocity, len(state))
    return np.array(rows)


# -- Numbers by hand


def test_a_delay_of_whole_ticks_shifts():
    assert through("velocity_delay", RAMP, delay_s=0.01)[:, 0].tolist() == [0.0, 0.0, 1.0, 2.0, 3.0]


def test_a_delay_of_a_part_of_a_tick_is_the_mean_of_two_commands():
    assert through("velocity_delay", RAMP, delay_s=0.3 * TICK_S)[:, 2] == pytest.approx(
        [70.0, 170.0, 270.0, 370.0, 470.0], rel=1e-6
    )


def test_the_longest_delay():
    many = np.outer(np.arange(70.0), np.ones(3))
    assert through("velocity_delay", many, delay_s=0.3)[-1] == pytest.approx([9.0, 9.0, 9.0])


def test_a_speed_limit_keeps_the_direction():
    assert through("velocity_saturation", [[0.3, -0.4, -2.0]], limit_m_s=0.25)[0] == pytest.approx([0.15, -0.2, -2.0])
    assert through("velocity_saturation", [[0.3, -0.4, -2.0]], limit_rad_s=0.5)[0].tolist() == [0.3, -0.4, -0.5]


def test_a_gain_for_each_axis():
    found = through("velocity_gain", [[1.0, 2.0, 3.0]], share_x=0.1, share_y=-0.1, share_yaw=0.2)
    assert found[0] == pytest.approx([1.1, 1.8, 3.6])


def test_coupling_turns_a_robot_that_is_told_to_go_straight():
    found = through("velocity_coupling", [[0.2, 0.1, 1.0]], yaw_per_x=0.5, yaw_per_y=-2.0)
    assert found[0] == pytest.approx([0.2, 0.1, 1.0 + 0.1 - 0.2])


@pytest.mark.parametrize("name", ["velocity_gain", "velocity_coupling"])
def test_a_robot_that_tyres_hold_sideways_has_no_number_for_that_way(name):
    differential = Body(robots()["rover"], RoverPlantParameters(wheels="differential"), 2)
    effect, left = library()[name], {key: value for key, value in SOME[name].items() if not key.endswith("_y")}
    assert [p.name for p in effect.parameters_of(differential)] == list(left)
    assert effect.block_parameters(differential, left).keys() == effect.block_parameters(BODY, SOME[name]).keys()


def test_a_lag_gives_the_mean_over_each_tick():
    constant, edges = 0.02, np.arange(4) * TICK_S
    reached = 1.0 - np.exp(-edges / constant)
    expected = 1.0 - np.diff(-constant * np.exp(-edges / constant)) / TICK_S  # mean of 1 - exp(-t/constant)
    assert through("velocity_lag", np.ones((3, 3)), time_constant_s=constant)[:, 1] == pytest.approx(expected)
    assert reached[0] < expected[0] < reached[1]


@pytest.mark.parametrize(("extra", "as_if"), [(0.0, 0.03), (0.02, 0.05), (-0.02, 0.01), (-0.04, 0.0)])
def test_turns_may_lag_by_another_time(extra, as_if):
    found = through("velocity_lag", RAMP, time_constant_s=0.03, turning_extra_s=extra)
    assert np.array_equal(found[:, :2], through("velocity_lag", RAMP, time_constant_s=0.03)[:, :2])
    assert found[:, 2] == pytest.approx(through("velocity_lag", RAMP, time_constant_s=as_if)[:, 2])


def test_an_acceleration_limit_keeps_the_direction_and_gives_the_mean_over_each_tick():
    limit = 0.2 / TICK_S  # a step of 0.5 m/s takes two and a half ticks
    found = through("velocity_slew_limit", [[0.3, -0.4, 0.0]] * 4, limit_m_s2=limit)
    means = [0.1, 0.3, 0.5 * 0.45 + 0.5 * 0.5, 0.5]
    assert found == pytest.approx(np.outer(means, [0.6, -0.8, 0.0]))


def test_turns_have_an_acceleration_limit_of_their_own():
    found = through("velocity_slew_limit", [[0.3, 0.0, -1.0], [0.3, 0.0, 1.0]], limit_rad_s2=1.0 / TICK_S)
    assert found == pytest.approx(np.array([[0.3, 0.0, -0.5], [0.3, 0.0, -0.5]]))


def test_brakes_take_their_time_and_what_rises_does_not():
    limit = 0.2 / TICK_S
    found = through("velocity_braking_limit", [[0.3, 0.4, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
                    limit_m_s2=limit)
    assert found == pytest.approx(np.outer([0.5, 0.4, 0.2, 0.5 * 0.5 * 0.1], [0.6, 0.8, 0.0]))


def test_a_reversal_brakes_to_rest_and_rises_at_once():
    found = through("velocity_braking_limit", [[0.0, 0.0, 0.5], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0]],
                    limit_rad_s2=0.4 / TICK_S)
    assert found[:, 2] == pytest.approx([0.5, 0.3, 0.25 * 0.05 - 0.75 * 1.0])


def test_a_change_of_direction_brakes_to_the_slowest_point_on_the_way():
    half = np.sqrt(0.5)  # from (1, 0) to (0, 1) the speed falls on the first half, which is so long
    found = through("velocity_braking_limit", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
                    limit_m_s2=half / TICK_S)
    assert found[1] == pytest.approx([0.75, 0.25, 0.0])
    assert found[2] == pytest.approx([0.0, 1.0, 0.0])


def test_a_dead_zone_slows_every_wheel_down_and_stops_the_slow_ones():
    geometry = BODY.plant.nominal_geometry
    told = geometry.forward @ [2.0, -0.3, 0.1]
    found = through("velocity_dead_zone", [told], width_rad_s=0.5)[0]
    assert geometry.inverse @ found == pytest.approx([1.5, 0.0, 0.0], abs=1e-12)


def test_of_more_wheels_than_ways_to_move_the_nearest_motion_is_taken():
    body = Body(robots()["rover"], RoverPlantParameters(wheels="mecanum"), 4)
    geometry, effect = body.plant.nominal_geometry, library()["velocity_dead_zone"]
    told, out = np.array([0.02, 0.01, 0.1]), np.empty(3)
    beyond_dead_zone(told, out=out, **effect.block_parameters(body, {"width_rad_s": 0.5}))
    wheels = geometry.inverse @ told
    nearest, *_ = np.linalg.lstsq(geometry.inverse, wheels - np.clip(wheels, -0.5, 0.5), rcond=None)
    assert np.sum(np.abs(wheels) < 0.5) == 2 and out == pytest.approx(nearest)


def test_each_wheel_has_a_limit_of_its_own():
    geometry = BODY.plant.nominal_geometry
    found = through("wheel_speed_limit", [geometry.forward @ [2.0, -0.3, -0.7]], limit_rad_s=0.5)[0]
    assert geometry.inverse @ found == pytest.approx([0.5, -0.3, -0.5])


def test_of_more_wheels_than_ways_to_move_the_nearest_motion_to_limited_ones_is_taken():
    body = Body(robots()["rover"], RoverPlantParameters(wheels="mecanum"), 4)
    geometry, effect = body.plant.nominal_geometry, library()["wheel_speed_limit"]
    told, out = np.array([0.3, 0.1, 0.5]), np.empty(3)
    wheels_limited(told, out=out, **effect.block_parameters(body, {"limit_rad_s": 5.0}))
    wheels = geometry.inverse @ told
    nearest, *_ = np.linalg.lstsq(geometry.inverse, np.clip(wheels, -5.0, 5.0), rcond=None)
    assert np.sum(np.abs(wheels) > 5.0) == 2 and out == pytest.approx(nearest)


def test_wheels_that_are_slowed_together_keep_the_curvature_and_the_fastest_of_them_its_limit():
    geometry = BODY.plant.nominal_geometry
    found = through("wheel_speed_desaturation", [geometry.forward @ [2.0, -0.3, -0.7]], limit_rad_s=0.5)[0]
    assert geometry.inverse @ found == pytest.approx([0.5, -0.075, -0.175])


@pytest.mark.parametrize("name", ["wheel_speed_limit", "wheel_speed_desaturation"])
def test_wheels_that_keep_to_their_limit_are_as_told(name):
    told = BODY.plant.nominal_geometry.forward @ [0.4, -0.3, 0.1]
    assert through(name, [told], limit_rad_s=0.5)[0] == pytest.approx(told, rel=1e-12)


@pytest.mark.parametrize("name", ["wheel_speed_limit", "wheel_speed_desaturation"])
def test_straight_on_a_limit_of_the_wheels_is_one_of_the_robot(name):
    body = Body(robots()["rover"], RoverPlantParameters(wheels="differential"), 2)
    effect, told, out = library()[name], np.array([0.8, 0.0, 0.0]), np.empty(3)
    type(effect).output(told, out=out, **effect.block_parameters(body, {"limit_rad_s": 5.0}))
    assert out == pytest.approx([5.0 * body.plant.radius_m, 0.0, 0.0])


@pytest.mark.parametrize("damping", [0.2, 0.8])
def test_an_overshoot_is_the_mean_of_the_solution_over_each_tick(damping):
    constant, edges = 0.02, TICK_S * np.arange(5)

    def rates(_, state):  # of velocity, its rate, and the way
        return [state[1], (1.0 - state[0] - 2.0 * damping * constant * state[1]) / constant**2, state[0]]

    way = solve_ivp(rates, (0.0, edges[-1]), [0.0, 0.0, 0.0], rtol=1e-10, atol=1e-12, t_eval=edges).y[2]
    means = np.diff(way) / TICK_S
    found = through("velocity_overshoot", np.ones((4, 3)), time_constant_s=constant, damping=damping)
    assert found[:, 1] == pytest.approx(means, rel=1e-6)


def test_an_overshoot_passes_the_command_by_what_its_damping_says():
    found = through("velocity_overshoot", np.ones((400, 3)), time_constant_s=0.05, damping=0.3)[:, 0]
    assert found.max() == pytest.approx(1.0 + np.exp(-np.pi * 0.3 / np.sqrt(1.0 - 0.3**2)), abs=2e-3)
    assert found[-1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_neutral_values_pass_every_number_unchanged(name):
    velocities = np.random.default_rng(0).normal(size=(80, 3))
    assert np.array_equal(through(name, velocities), velocities)


# -- In a Diagram


def test_at_neutral_values_the_run_is_the_base_run():
    every = {name: {} for name in NAMES}
    alone = simulate_compiled(load_scenario("velocity_base", ["seconds=6"]))
    listed = simulate_compiled(load_scenario("velocity_base", ["seconds=6", f"rover.effects={every}"]))
    for signal, rows in alone.signals.items():
        assert np.array_equal(rows, listed.signals[signal]), signal


def test_drake_and_the_compiled_rollout_agree_to_the_bit():
    scenario = load_scenario("velocity_base", ["seconds=5", f"rover.effects={SOME}"])
    assert parity(scenario)["max_abs_difference"] == 0.0


def test_a_diagram_without_commands_leaves_them_out():
    overrides = ["seconds=2", "rover.trajectory.start_s=0.2"]
    ahead = {"velocity_gain": {"share_x": 0.1, "share_yaw": 0.2}, "velocity_coupling": {"yaw_per_x": 0.3}}
    alone = simulate_compiled(load_scenario("odometry_replay", overrides))
    listed = simulate_compiled(load_scenario("odometry_replay", [*overrides, f"rover.effects={SOME | ahead}"]))
    assert np.array_equal(alone.signals["rover_pose"], listed.signals["rover_pose"])


@pytest.mark.parametrize("override, message", [
    ("velocity_delay.delay_s=-0.01", r"rover.effects.velocity_delay.delay_s: expected at least 0 \[s\], got -0.01"),
    ("velocity_delay.delay_s=0.8", r"expected at most 0.7 \[s\]"),
    ("velocity_saturation.limit_m_s=0", r"velocity_saturation.limit_m_s: expected at least 1e-06 \[m/s\], got 0"),
    ("wheel_speed_limit.limit_rad_s=0", r"wheel_speed_limit.limit_rad_s: expected at least 1e-06 \[rad/s\], got 0"),
    ("velocity_gain.share=0.1", "velocity_gain.share: unknown parameter, did you mean 'share_y'"),
    ("velocity_lag.time_constant_s=.inf", "expected a finite number"),
    ("velocity_lagg={}", "there is no such effect, did you mean 'velocity_lag'"),
])
def test_bad_values_are_refused(override, message):
    with pytest.raises(InputError, match=message):
        load_scenario("velocity_base", [f"rover.effects.{override}"])
