"""Effects of encoder, IMU and link: numbers by hand, nothing at neutral, the same in both engines."""

import numpy as np
import pytest
from passing import passed, with_effects
from rail import rail

from drake_ispace.blocks.errors import InputError
from drake_ispace.effects.effect import Body
from drake_ispace.effects.library import library
from drake_ispace.effects.places.imu import lagged, remember_lagged, rotation
from drake_ispace.robots.library import robots
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import load_scenario

OMNI, PENDULUM = Body(robots()["omni"], None, 4), Body(robots()["pendulum"], None, 2)
#: Effects in these files -> a value away from neutral.
OF_ALL = {
    "encoder_scale": {"share": 0.02}, "encoder_lost_counts": {"wheel": 2, "share": 0.03},
    "encoder_eccentricity": {"wheel": 1, "sine_rad": 0.02, "cosine_rad": -0.01}, "clock_offset": {"offset_s": 0.0},
}
OF_IMU = {
    "gyro_bias": {"pitch_rad_s": 0.01, "yaw_rad_s": -0.02}, "gyro_scale": {"share": 0.02},
    "accelerometer_bias": {"x_m_s2": 0.05, "z_m_s2": -0.1}, "accelerometer_scale": {"share": -0.02},
    "imu_misalignment": {"about_x_rad": 0.03, "about_z_rad": -0.02}, "imu_offset": {"ahead_m": 0.02, "above_m": 0.03},
    "imu_lag": {"time_constant_s": 0.01},
}


def pendulum(effects):
    """A robot that has every sensor."""
    return with_effects("pendulum_multirate", effects, "seconds=2")


# By hand


def test_every_encoder_shows_a_share_more():
    assert passed("encoder_scale", OMNI, [1.0, -2.0, 0.0, 4.0], share=0.25) == pytest.approx([1.25, -2.5, 0.0, 5.0])


def test_one_encoder_loses_counts_to_and_fro():
    assert passed("encoder_lost_counts", OMNI, [1, 2, 3, 4], wheel=3, share=0.5) == pytest.approx([1, 2, 1.5, 4])
    assert passed("encoder_lost_counts", PENDULUM, [-8, -8], wheel=1, share=0.25) == pytest.approx([-6, -8])
    assert passed("encoder_lost_counts", PENDULUM, [-8, -8], wheel=2, share=-0.25) == pytest.approx([-8, -10])


def test_an_eccentric_encoder_errs_once_a_turn():
    quarters = np.pi / 2 * np.array([0, 1, 2, 4])
    shown = [passed("encoder_eccentricity", OMNI, [q] * 4, wheel=2, sine_rad=0.1, cosine_rad=0.2) for q in quarters]
    assert np.array(shown)[:, 1] - quarters == pytest.approx([0.0, -0.1, -0.4, 0.0])
    assert np.array(shown)[:, 0] == pytest.approx(quarters)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_which_counts_go_missing_or_come_twice_is_chance(sign):
    share = 0.06
    angles, count = np.outer(np.arange(20000), [1.0 - sign * share, 0.0, 2.0, 1.0]), 0.5
    effect, random = library()["encoder_lost_counts"], np.random.default_rng(0)
    added = effect.scattered(angles, {"wheel": 1, "share": sign * share}, count, random) - angles
    lost = random.binomial(2, share, 20000) * count  # of two counts a step
    assert np.diff(added[:, 0]).std() == pytest.approx(lost.std(), rel=0.03)
    assert not added[:, 1:].any()


MOTION = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def test_constants_and_shares_of_the_imu():
    biased = passed("gyro_bias", PENDULUM, MOTION, pitch_rad_s=0.5, yaw_rad_s=-0.25)
    assert biased == pytest.approx([1, 2, 3, 4, 5.5, 5.75])
    assert passed("gyro_scale", PENDULUM, MOTION, share=0.5) == pytest.approx([1, 2, 3, 6, 7.5, 9])
    assert passed("accelerometer_bias", PENDULUM, MOTION, x_m_s2=0.5, z_m_s2=-1) == pytest.approx([1.5, 2, 2, 4, 5, 6])
    assert passed("accelerometer_scale", PENDULUM, MOTION, share=0.5) == pytest.approx([1.5, 3, 4.5, 4, 5, 6])


def test_an_imu_turned_about_z_reads_what_points_ahead_as_to_its_right():
    # Its own x axis points between the body's x and y.
    ahead = passed("imu_misalignment", PENDULUM, [1, 0, 0, 0, 1, 0], about_z_rad=0.3)
    assert ahead == pytest.approx([np.cos(0.3), -np.sin(0.3), 0, np.sin(0.3), np.cos(0.3), 0])


def test_an_imu_turned_about_x_reads_gravity_as_to_its_left():
    standing = passed("imu_misalignment", PENDULUM, [0, 0, 9.8, 0, 0, 1], about_x_rad=0.1)
    assert standing == pytest.approx([0, 9.8 * np.sin(0.1), 9.8 * np.cos(0.1), 0, np.sin(0.1), np.cos(0.1)])


def test_an_imu_elsewhere_on_a_turning_body_feels_what_draws_it_inwards():
    ahead = passed("imu_offset", PENDULUM, [0, 0, 9.8, 0, 0, 2.0], ahead_m=0.5)
    assert ahead == pytest.approx([-4.0 * 0.5, 0, 9.8, 0, 0, 2.0])
    above = passed("imu_offset", PENDULUM, [0, 0, 9.8, 0, 3.0, 0], above_m=0.1)
    assert above == pytest.approx([0, 0, 9.8 - 9.0 * 0.1, 0, 3.0, 0])
    assert passed("imu_offset", PENDULUM, MOTION, ahead_m=0.5, above_m=0.2) == pytest.approx(
        [-24.7, 18.0, 6.8, 4.0, 5.0, 6.0]
    )


def test_a_misaligned_imu_still_measures_lengths():
    turned = passed("imu_misalignment", PENDULUM, MOTION, about_x_rad=0.4, about_z_rad=-0.3)
    assert np.linalg.norm(turned.reshape(2, 3), axis=1) == pytest.approx(np.linalg.norm([[1, 2, 3], [4, 5, 6]], axis=1))
    matrix = rotation([0.4, 0.0, -0.3])
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-15)
    assert matrix @ [0.4, 0.0, -0.3] == pytest.approx([0.4, 0.0, -0.3])


def test_a_low_pass_begins_at_the_first_reading_and_follows_by_its_share():
    keep, first, later = np.exp(-0.5), np.ones(6), np.full(6, 3.0)
    memory, stored = np.zeros(7), np.empty(7)
    remember_lagged(memory, first, keep, stored)
    assert stored == pytest.approx(np.ones(7))
    out = np.empty(6)
    lagged(stored, later, keep, out)
    assert out == pytest.approx(np.full(6, 3.0 - 2.0 * keep))


@pytest.mark.parametrize("offset_s, stamp", [(0.0, 38), (0.05, 48), (-0.05, 28), (0.0124, 40), (0.0126, 41)])
def test_a_clock_moves_the_stamp_by_whole_ticks(offset_s, stamp):
    message = passed("clock_offset", OMNI, [38, 1, 0.1, 0.2, 0.3], offset_s=offset_s)
    assert message.tolist() == [stamp, 1, 0.1, 0.2, 0.3]


def test_no_stamp_lies_before_the_robots_first_tick():
    # -1 would mean that nothing has come yet.
    for tick in (0, 18, 19, 20):
        assert passed("clock_offset", OMNI, [tick, 1, 0.1, 0.2, 0.3], offset_s=-0.1)[0] == 0.0
    assert passed("clock_offset", OMNI, [21, 1, 0.1, 0.2, 0.3], offset_s=-0.1)[0] == 1.0


@pytest.mark.parametrize("offset_s", [-0.1, 0.1])
@pytest.mark.parametrize("fix", [[-1, 0, 0, 0, 0], [19, 0, 0, 0, 0]])
def test_a_message_without_the_robot_is_left_alone(fix, offset_s):
    assert np.array_equal(passed("clock_offset", OMNI, fix, offset_s=offset_s), fix)


# In the Diagram


@pytest.fixture(scope="module")
def at_neutral():
    """All effects of these files at once, changing nothing, and a run without them."""
    neutral = {name: library()[name].neutral(PENDULUM) for name in OF_ALL | OF_IMU}
    return simulate_compiled(pendulum(neutral)).signals, simulate_compiled(pendulum({})).signals


def test_at_neutral_every_signal_is_that_of_the_base_model(at_neutral):
    neutral, base = at_neutral
    assert [name for name in base if not np.array_equal(neutral[name], base[name])] == []


def test_both_engines_agree_on_effects_of_encoder_and_imu(at_neutral):
    assert parity(pendulum(OF_ALL | OF_IMU))["max_abs_difference"] == 0.0


def test_the_effects_show_in_what_is_measured(at_neutral):
    neutral, _ = at_neutral
    signals = simulate_compiled(pendulum(OF_ALL | OF_IMU)).signals
    standing = signals["pendulum_imu"][1, 1:] - neutral["pendulum_imu"][1, 1:]  # the sample of tick 0, upright
    axes = rotation([0.03, 0.0, -0.02]).T
    gravity = 0.98 * 9.81 * axes[1:, 2] - [0.0, 9.81 + 0.1]
    assert standing == pytest.approx([0.05, *gravity, 0.0, 0.01, -0.02], abs=0.02)
    assert np.abs(signals["pendulum_encoder"] - neutral["pendulum_encoder"]).max() > 0.1


@pytest.mark.parametrize("setting, words", [
    ("omni.effects.encoder_lost_counts.wheel=5", "at most 4"),
    ("omni.effects.encoder_lost_counts.share=0.6", "at most 0.5"),
    ("omni.effects.encoder_scale.shares=0.1", "unknown parameter"),
    ("omni.effects.gyro_bias.pitch_rad_s=0.1", "cannot have it"),
    ("pendulum.effects.imu_misalignment.about_y_rad=0.1", "unknown parameter"),
    ("pendulum.effects.clock_offset.offset_s=0.2", "at most 0.15 \\[s\\]"),
    ("pendulum.effects.gyro_scale.share=much", "expected a number"),
])
def test_what_cannot_be_is_refused(setting, words):
    with pytest.raises(InputError, match=words):
        load_scenario("shared_space", [setting])


def test_wheels_of_a_robot_of_ones_own_can_have_wrong_encoders():
    own = rail()
    general = [name for name in (*OF_ALL, *OF_IMU) if library()[name].applies_to(own)]
    assert general == ["encoder_scale", "encoder_lost_counts"]
    assert passed("encoder_lost_counts", own, [2.0], share=0.5) == pytest.approx([1.0])
