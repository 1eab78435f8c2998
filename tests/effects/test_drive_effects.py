"""Effects between command and wheel in a run: neutral values, parity with Drake, bad values."""

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.effects.effect import body_of
from drake_ispace.effects.places import actuator, transmission
from drake_ispace.robots.library import robots
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import Scenario, load_scenario

BY_NAME = {effect.name: effect for effect in (*actuator.EFFECTS, *transmission.EFFECTS)}
#: One scenario has them all, so that it is compiled once.
LISTED = [f"omni.effects.{name}={{}}" for name in BY_NAME]
OMNI = body_of(Scenario(), robots()["omni"])
#: About the root mean squares of this run [N m, rad/s], of which the probes of a card are multiples.
SCALES = {"": 1.0, "torque": 0.02, "1/torque": 50.0, "speed": 5.0, "torque/speed": 0.004}


def at_probes(effect):
    """A setting with the effect as large as the last probes on its card, on the second wheel if it has one."""
    values = {p.name: p.probes[-1] * SCALES[p.scale] for p in effect.parameters_of(OMNI)}
    return f"omni.effects.{effect.name}={values | dict.fromkeys(effect.choices, 2)}"


def run(*overrides):
    return simulate_compiled(load_scenario("omni_multirate", ["seconds=2", *overrides])).signals


@pytest.fixture(scope="module")
def neutral():
    return run(*LISTED)


def test_neutral_values_change_no_bit(neutral):
    for name, rows in run().items():
        assert np.array_equal(rows, neutral[name]), name


@pytest.mark.parametrize("name", BY_NAME)
def test_other_values_change_the_run(name, neutral):
    assert not np.array_equal(run(*LISTED, at_probes(BY_NAME[name]))["omni_pose"], neutral["omni_pose"])


@pytest.mark.first_case
@pytest.mark.parametrize("place", [actuator, transmission], ids=["actuator", "transmission"])
def test_parity_with_drake_with_all_of_them(place):
    strong = map(at_probes, place.EFFECTS)
    found = parity(load_scenario("omni_multirate", ["seconds=2", *LISTED, *strong]))
    assert found["ticks"] == 400 and found["max_abs_difference"] == 0.0


def test_strong_dry_friction_does_not_rattle(neutral):
    strong = run(*LISTED, "omni.effects.coulomb_friction.torque_n_m=0.05")["omni_velocity"]
    jumps, before = (np.abs(np.diff(rows, axis=0)).max(axis=0) for rows in (strong, neutral["omni_velocity"]))
    assert (jumps < 2.0 * before).all()


@pytest.mark.parametrize("bad", [
    "omni.command_delay.delay_s=0.061", "omni.command_delay.delay_s=-0.001", "omni.torque_saturation.limit_n_m=0",
    "omni.torque_saturation.limit_n_m=.inf", "omni.torque_slew_limit.rate_n_m_s=-1",
    "omni.actuator_dead_zone.width_n_m=-0.1", "omni.torque_gain_error.share=0.8", "omni.weak_motor.wheel=5",
    "omni.weak_motor.wheel=1.5", "omni.weak_motor.loss=1", "omni.battery_sag_time.rate_per_s=0.1",
    "omni.battery_sag_load.share_per_n_m=-1", "omni.motor_lag.time_constant_s=0.3", "omni.motor_lag.time_s=0.1",
    "omni.viscous_friction.coefficient_n_m_s=0.17",  # the 5 ms step allows 0.163
    "omni.viscous_friction.coefficient_n_m_s=-0.001", "pendulum.viscous_friction.coefficient_n_m_s=-0.011",
    "omni.coulomb_friction.torque_n_m=-0.001", "pendulum.coulomb_friction.torque_n_m=-0.0062",
    "omni.stribeck_friction.bump_n_m=-1", "omni.stribeck_friction.speed_rad_s=0",
    "omni.load_dependent_friction.share=1", "omni.transmission_backlash.gap_rad=-0.1",
    "omni.transmission_backlash.gap_m=0.1",
])
def test_bad_values_are_refused_by_name(bad):
    robot, _, setting = bad.partition(".")
    with pytest.raises(InputError, match=setting.partition("=")[0].replace(".", r"\.")):
        load_scenario(f"{robot}_multirate", [f"{robot}.effects.{setting}"])
