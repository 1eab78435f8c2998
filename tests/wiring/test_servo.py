"""The Diagrams of chapters 3 and 4."""

import numpy as np
import pytest

from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.control.feedback.balance_gains import linearised
from drake_ispace.control.feedback.dlqr import zero_order_hold
from drake_ispace.plants.pendulum import PendulumPlantParameters
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.thesis.friction_data import friction_rollout, silence
from drake_ispace.thesis.servo_data import servo_rollout


def test_the_servo_reaches_its_reference_and_returns():
    run = simulate_compiled(load_scenario("pendulum_servo"))
    x = run.signals["pendulum_pose"][:, 0]
    assert abs(x[ticks_in(10.5)] - 1.0) < 0.02 and abs(x[-1]) < 0.02


def servo_matrices(a, b, sign):
    """Closed loop in continuous time, and the spectral radius at 5 ms, of x = [s, theta, s_dot, theta_dot, omega]."""
    extended, drive = np.zeros((5, 5)), np.zeros((5, 1))
    extended[:4, :4], extended[4, 0], drive[:4, 0] = a, -1.0, b
    gain = sign * np.array([[6.7056, 2.1560, 6.0055, 0.6502, -3.5355]])
    continuous = np.linalg.eigvals(extended - drive @ gain).real.max()
    a_d, b_d = zero_order_hold(extended, drive, TICK_S)
    return continuous, np.abs(np.linalg.eigvals(a_d - b_d @ gain)).max()


def test_the_printed_gains_balance_the_printed_plant():
    a, b = np.zeros((4, 4)), np.array([0.0, 0.0, 2 * -1.73, 2 * 35.39])
    a[0, 2] = a[1, 3] = 1.0
    a[2:, 1] = 1.21, -9.87
    continuous, radius = servo_matrices(a, b, 1.0)
    assert continuous == pytest.approx(-0.80, abs=0.01) and radius < 1.0


def test_with_the_other_sign_they_balance_the_corrected_plant_but_not_at_5_ms():
    a6, b6 = linearised(PendulumPlantParameters())
    rows = [0, 2, 3, 5]
    continuous, radius = servo_matrices(a6[np.ix_(rows, rows)], b6[rows].sum(axis=1), -1.0)
    assert continuous == pytest.approx(-0.59, abs=0.01) and radius > 1.0


def test_the_servo_integrates_the_measured_error():
    logs = servo_rollout(load_scenario("pendulum_servo", ["pendulum.servo.f=[0, 0, 0, 0]"])).run(ticks_in(2.0))
    moving = logs["pendulum_way_point"][:, 1] > 0.5
    slope = np.diff(logs["pendulum_torque"][:, 0])[moving[1:]][5:20] / TICK_S
    assert slope == pytest.approx(3.5355, rel=0.05)


@pytest.mark.parametrize("scenario", [
    ("pendulum_friction_excitation", []),
    ("pendulum_friction_compensation", ["pendulum.adaptation.enabled=true"]),
    ("pendulum_servo", ["pendulum.sensor_noise.white_share=0.5"]),
], ids=["excitation", "adaptive", "white noise"])
def test_drake_and_the_compiled_rollout_agree(scenario):
    name, overrides = scenario
    assert parity(load_scenario(name, [*overrides, "seconds=3"]))["max_abs_difference"] == 0.0


def push(**compensation):
    overrides = [f"pendulum.control.friction_compensation.{key}={value}" for key, value in compensation.items()]
    return simulate_compiled(load_scenario("pendulum_friction_compensation", overrides)).signals


def test_the_push_acts_from_1_2_to_1_6_s():
    pushed, calm = (
        simulate_compiled(load_scenario("pendulum_friction_compensation", [f"pendulum.impulse.torque_n_m={torque}"]))
        for torque in (0.05, 0.0)
    )
    difference = np.abs(pushed.signals["pendulum_balance"] - calm.signals["pendulum_balance"]).max(axis=1)
    assert difference[: ticks_in(1.2) + 1].max() == 0.0
    assert difference[ticks_in(1.2) + 1] > 0.0


def test_compensation_lowers_both_error_integrals():
    def integral(signals, port):
        return np.abs(signals[port][ticks_in(1.2) :, 0]).sum()

    with_it, without = push(), push(enabled="false")
    assert integral(with_it, "pendulum_pose") < 0.85 * integral(without, "pendulum_pose")
    assert integral(with_it, "pendulum_balance") < 0.75 * integral(without, "pendulum_balance")


def rest(overrides):
    """Peak to peak of the position [m] in the last 10 of 40 s, encoder counts on, no noise."""
    scenario = load_scenario("pendulum_friction_compensation", [
        "pendulum.impulse.torque_n_m=0", "pendulum.initial_tilt_rad=0.005", *overrides
    ])
    rollout = friction_rollout(scenario)
    parameters = silence(rollout)
    ticks = ticks_in(40.0)
    return np.ptp(rollout.run(ticks, parameters)["pendulum_pose"][-ticks_in(10.0) :, 0])


def test_counts_alone_make_no_limit_cycle():
    smooth = ["pendulum.plant.friction.coulomb_n_m=0", "pendulum.control.friction_compensation.coulomb_n_m=0"]
    assert rest(smooth) < 1e-3


def test_coulomb_friction_makes_one_that_a_wide_dead_band_keeps():
    none = rest(["pendulum.control.friction_compensation.enabled=false"])
    wide = rest(["pendulum.control.friction_compensation.dead_band_rad_s=0.1",
                 "pendulum.control.friction_compensation.speed_scale_rad_s=0.2"])
    assert none > 0.03
    assert 0.4 * none < wide < 0.9 * none


def test_without_dead_band_it_all_but_ends():
    assert rest([]) < 0.005
