"""What one channel shows by itself is told from what chance, or another unit of time, makes of it."""

import numpy as np
import pytest

from drake_ispace.explain.check.compare.agreement import following
from drake_ispace.explain.check.compare.regression import Slack, most, scores
from drake_ispace.explain.check.sampling.samples import sample_findings, wrap_findings
from drake_ispace.explain.check.sampling.stamps import stamp_findings
from drake_ispace.explain.levels import largest_by_chance
from drake_ispace.files.recording import Channel, Recording

COLUMNS = {"imu": ("ax", "ay", "az", "wx", "wy", "wz"), "torque": ("tau_1", "tau_2"), "encoder": ("theta_1", "theta_2"),
           "kinect": ("x", "y", "phi")}


def recording(**channels):
    """A run of channels, each (t (n,), values (n,) of all its columns)."""
    return Recording("mine", channels={
        name: Channel(t, COLUMNS[name], np.column_stack([values] * len(COLUMNS[name])))
        for name, (t, values) in channels.items()
    })


def faults(findings):
    return [finding.fault for finding in findings]


@pytest.mark.parametrize("components", [1, 2])
def test_the_largest_of_many_distances_is_hardly_ever_larger_by_chance(components):
    far = np.linalg.norm(np.random.default_rng(0).standard_normal((4000, 100, components)), axis=2)
    share = np.mean(far.max(axis=1) > largest_by_chance(100, components) * np.median(far))
    assert share < 3e-3
    assert np.mean(far.max(axis=1) > 0.8 * largest_by_chance(100, components) * np.median(far)) > 3e-3


def test_values_pile_up_at_an_extreme_that_is_clipped_and_at_no_other():
    t = 0.005 * np.arange(4000)
    noise = np.round(20.0 * np.random.default_rng(0).standard_normal(4000))
    assert faults(sample_findings(recording(imu=(t, noise)))) == []
    assert faults(sample_findings(recording(imu=(t, np.clip(noise, -40.0, 40.0))))) == ["channel_clipped"]


def test_a_channel_that_often_holds_its_value_is_not_stuck_where_it_holds_it_by_chance():
    random, t = np.random.default_rng(0), 0.005 * np.arange(4000)
    noise = random.standard_normal(4000)
    frozen = noise.copy()
    frozen[2000:2200] = frozen[2000]
    assert faults(sample_findings(recording(torque=(t, frozen)))) == ["channel_frozen"]
    held = noise[np.maximum.accumulate(np.where(random.random(4000) < 0.02, np.arange(4000), 0))]
    held[[10, 20]] = 9.0, -9.0
    assert faults(sample_findings(recording(torque=(t, held)))) == []


@pytest.mark.parametrize("rests", [True, False])
def test_a_column_may_hold_its_value_while_a_wheel_rests(rests):
    """As the torque of that wheel does."""
    random, t = np.random.default_rng(0), 0.005 * np.arange(4000)
    turning = np.sin(t)
    resting = np.sin(t - np.clip(t - 5.0, 0.0, 3.0)) if rests else 1.1 * turning
    torques = random.standard_normal((4000, 2))
    torques[(t > 5.0) & (t < 8.0), 1] = 0.31
    wheels = Channel(t, COLUMNS["encoder"], np.column_stack([turning, resting]))
    run = Recording("mine", channels={"encoder": wheels, "torque": Channel(t, COLUMNS["torque"], torques)})
    assert faults(sample_findings(run)) == ([] if rests else ["channel_frozen"])


@pytest.mark.parametrize(("every_s", "factor", "fault"), [
    (1.3, 1.0, []), (0.04, 1e3, ["time_unit"]), (0.04, 1e6, ["time_unit"]), (3.0, 1e3, ["time_unit"]),
])
def test_a_camera_lasts_as_long_as_the_wheels_in_the_right_unit_of_time(every_s, factor, fault):
    t, seen = 0.005 * np.arange(8000), np.arange(0.0, 40.0, every_s)
    run = recording(encoder=(t, np.sin(t)), kinect=(factor * seen, np.sin(seen)))
    findings = list(stamp_findings(run))
    assert faults(findings) == fault
    assert all(np.isclose(finding.repairs[0].rate * factor, 1.0) for finding in findings)


@pytest.mark.parametrize(("range_rad", "fault"), [(50.0, ["counter_wrap"]), (190.0, [])])
def test_a_counter_of_unknown_range_starts_anew_more_than_once(range_rad, fault):
    t = 0.005 * np.arange(4000)
    assert faults(wrap_findings(recording(encoder=(t, (10.0 * t) % range_rad)), 2000.0)) == fault


def test_a_relation_that_is_known_up_to_a_factor_is_as_wrong_either_way():
    slack = Slack.of_factor(4.0)
    assert (1.0 + slack.least) * (1.0 + slack.most) == pytest.approx(1.0)


@pytest.mark.parametrize("size", [1.0, 0.2, 0.04])
def test_a_channel_that_moves_little_beyond_its_noise_follows_as_well_as_one_that_moves_much(size):
    generator, noise = np.random.default_rng(3), np.array([[0.01]])
    x = size * generator.standard_normal((1, 60, 1))
    y = x + 0.01 * generator.standard_normal(x.shape)
    related, unrelated, exact = (
        float(one[0]) for one in (scores(x, y, ((0,),), noise), scores(0.0 * x, y, ((0,),), noise),
                                  most(y, ((0,),), noise))
    )
    assert 0.7 < following(related, unrelated, exact) < 1.3
