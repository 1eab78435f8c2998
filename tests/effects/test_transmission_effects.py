"""Effects between motor and wheel: numbers by hand, neutral values, parity with Drake, bad values."""

import math

import numpy as np
import pytest

from drake_ispace.effects import actuator
from drake_ispace.effects.effect import Body, EffectBlock
from drake_ispace.effects.transmission import EFFECTS, lead, motor_angle
from drake_ispace.errors import InputError
from drake_ispace.rates import TICK_S
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import body_of, load_scenario

BY_NAME = {effect.card.name: effect for effect in EFFECTS}
STRONG = {
    "viscous_friction": "{coefficient_n_m_s: 0.0005}", "coulomb_friction": "{torque_n_m: 0.003}",
    "stribeck_friction": "{bump_n_m: 0.002, speed_rad_s: 2.0}", "load_dependent_friction": "{share: 0.1}",
    "transmission_backlash": "{gap_rad: 0.05}",
}
#: One scenario has them all, the actuator's too: it is compiled once for both files of tests.
LISTED = [f"omni.effects.{effect.card.name}={{}}" for effect in (*actuator.EFFECTS, *EFFECTS)]
RAIL = Body("rail", "rail", None, 3)


def robot_body(robot, *overrides):
    return body_of(load_scenario(f"{robot}_multirate", list(overrides)), robot)


def given(name, torque, wheel_rate, body=RAIL, **values):
    """The torque that a block on a bare Context lets through."""
    block = EffectBlock(BY_NAME[name], body, BY_NAME[name].neutral(body) | values)
    context = block.CreateDefaultContext()
    block.GetInputPort("torque").FixValue(context, torque)
    block.GetInputPort("wheel_rate").FixValue(context, wheel_rate)
    return block.GetOutputPort("torque").Eval(context)


# ------------------------------------------------------------------------------------------------------ by hand


def test_viscous_friction_grows_with_speed():
    assert given("viscous_friction", [1, 1, 1], [0, 2, -4], coefficient_n_m_s=0.1) == pytest.approx([1.0, 0.8, 1.4])


def test_coulomb_friction_is_of_one_size_and_smooth_at_standstill():
    assert given("coulomb_friction", [1, 1, 1], [0, 9, -9], torque_n_m=0.2) == pytest.approx([1.0, 0.8, 1.2])
    (slow, *_) = given("coulomb_friction", [0, 0, 0], [0.05, 0, 0], torque_n_m=0.2)
    assert slow == pytest.approx(-0.2 * math.tanh(1.0))


def test_the_stribeck_bump_fades_with_speed():
    left = given("stribeck_friction", [0, 0, 0], [1, 2, -2], bump_n_m=0.2, speed_rad_s=2.0)
    assert left == pytest.approx([-0.2 * math.exp(-0.25), -0.2 * math.exp(-1), 0.2 * math.exp(-1)])


def test_load_dependent_friction_weakens_the_drive_and_helps_the_brake():
    assert given("load_dependent_friction", [1, -1, 0], [9, 9, 9], share=0.2) == pytest.approx([0.8, -1.2, 0.0])


def test_backlash_leads_by_half_a_gap_and_crosses_it_as_the_torque_drives():
    half, rate, wheel, xd, leads = 0.05, 4.0 / TICK_S, np.array([1.0]), np.zeros(1), []
    for torque in (0.0, 0.01, 0.01, 0.0, -0.01, -0.01, -0.01):
        out, after = np.empty(1), np.empty(1)
        motor_angle(xd, wheel, np.array([torque]), half, rate, out)
        lead(xd, np.array([torque]), half, rate, after)
        assert out == wheel + after  # what the encoder reads is what is remembered
        leads.append(after[0])
        xd = after
    assert leads == pytest.approx([0.0, 0.04, 0.05, 0.05, 0.01, -0.03, -0.05])


# ------------------------------------------------------------------------------------------------ in a scenario


def run(*overrides):
    return simulate_compiled(load_scenario("omni_multirate", ["seconds=2", *overrides])).signals


@pytest.fixture(scope="module")
def neutral():
    return run(*LISTED)


def test_neutral_values_change_no_bit(neutral):
    for name, rows in run().items():
        assert np.array_equal(rows, neutral[name]), name


@pytest.mark.parametrize("name", STRONG)
def test_other_values_change_the_run(name, neutral):
    assert not np.array_equal(run(*LISTED, f"omni.effects.{name}={STRONG[name]}")["omni_pose"], neutral["omni_pose"])


def test_strong_dry_friction_does_not_rattle(neutral):
    strong = run(*LISTED, "omni.effects.coulomb_friction.torque_n_m=0.05")["omni_velocity"]
    jumps, before = (np.abs(np.diff(rows, axis=0)).max(axis=0) for rows in (strong, neutral["omni_velocity"]))
    assert (jumps < 2.0 * before).all()


def test_parity_with_drake_with_all_of_them():
    strong = [f"omni.effects.{name}={values}" for name, values in STRONG.items()]
    found = parity(load_scenario("omni_multirate", ["seconds=2", *LISTED, *strong]))
    assert found["ticks"] == 400 and found["max_abs_difference"] == 0.0


@pytest.mark.parametrize(("robot", "bad"), [
    ("omni", "viscous_friction.coefficient_n_m_s=0.17"),  # the 5 ms step allows 0.163
    ("omni", "viscous_friction.coefficient_n_m_s=-0.001"), ("pendulum", "viscous_friction.coefficient_n_m_s=-0.011"),
    ("omni", "coulomb_friction.torque_n_m=-0.001"), ("pendulum", "coulomb_friction.torque_n_m=-0.0062"),
    ("omni", "stribeck_friction.bump_n_m=-1"), ("omni", "stribeck_friction.speed_rad_s=0"),
    ("omni", "load_dependent_friction.share=1"), ("omni", "transmission_backlash.gap_rad=-0.1"),
    ("omni", "transmission_backlash.gap_m=0.1"),
])
def test_bad_values_are_refused_by_name(robot, bad):
    with pytest.raises(InputError, match=bad.partition("=")[0].replace(".", r"\.")):
        load_scenario(f"{robot}_multirate", [f"{robot}.effects.{bad}"])
