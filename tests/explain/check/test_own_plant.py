"""Are the recordings of a plant of one's own checked, of which only torque and wheel angles are known?"""

import re
from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import kernel
from drake_ispace.explain.check.check import check
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.files.recording import Channel, Recording

INERTIA = 0.02


@kernel
def accelerate(xc, torque, inertia, out):
    for i in range(2):
        out[i] = xc[2 + i]
        out[2 + i] = torque[i] / inertia


@kernel
def angle(xc, out):
    out[0], out[1] = xc[0], xc[1]


@kernel
def rate(xc, out):
    out[0], out[1] = xc[2], xc[3]


MODEL = OwnModel(Block(Spec(
    inputs={"torque": 2}, outputs={"wheel_angle": Output(2, angle), "wheel_rate": Output(2, rate)},
    parameters={"inertia": INERTIA}, continuous_state=np.zeros(4), derivatives=accelerate,
)))


def run(inertia=INERTIA, seconds=12.0, seed=0):
    """Two wheels with friction that the model lacks, logged at 500 Hz."""
    h, generator = 2e-3, np.random.default_rng(seed)
    t = np.arange(0.0, seconds, h)
    level = 0.15 * generator.standard_normal((int(seconds / 0.4) + 1, 2))
    torque = level[(t / 0.4).astype(int)] + 0.1 * np.column_stack([np.sin(3.0 * t), np.cos(2.3 * t + seed)])
    theta, omega = np.zeros((len(t), 2)), np.zeros(2)
    for i in range(1, len(t)):
        theta[i] = theta[i - 1] + h * omega
        omega = omega + h * (torque[i] - 0.01 * omega - 0.03 * np.arctan(omega / 0.1)) / inertia
    return Recording("two", channels={
        "torque": Channel(t, ("tau_1", "tau_2"), torque, {}, h),
        "encoder": Channel(t, ("theta_1", "theta_2"), 1e-3 * np.round(theta / 1e-3), {}, h),
    })


@pytest.fixture(scope="module")
def sound():
    """Two runs."""
    return [run(seed=0), run(seed=1)]


def mixed(channel, matrix):
    """The runs with a channel's columns multiplied by a matrix."""
    def change(recording):
        old = recording.channels[channel]
        new = replace(old, values=old.values @ np.atleast_2d(matrix))
        return replace(recording, channels=recording.channels | {channel: new})
    return change


def late(recording):
    """The torque's clock 0.7 s late."""
    old = recording.channels["torque"]
    return replace(recording, channels=recording.channels | {"torque": replace(old, t=old.t + 0.7)})


def held(recording):
    """An encoder that repeats itself for two seconds."""
    old = recording.channels["encoder"]
    values = old.values.copy()
    values[2000:3000] = values[2000]
    return replace(recording, channels=recording.channels | {"encoder": replace(old, values=values)})


FAULTS = {
    "torque_sign": mixed("torque", -np.eye(2)), "wheel_sign": mixed("encoder", np.diag([1.0, -1.0])),
    "torques_swapped": mixed("torque", np.eye(2)[::-1]), "wheels_swapped": mixed("encoder", np.eye(2)[::-1]),
    "wrong_unit": mixed("torque", 1e3 * np.eye(2)), "counts_per_turn": mixed("encoder", 10.0 * np.eye(2)),
    "clock_offset": late, "channel_frozen": held, "channel_dead": mixed("encoder", np.diag([1.0, 0.0])),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_mistake_is_named_or_stands_beside_what_is_named(sound, fault):
    finding = check(MODEL, [FAULTS[fault](one) for one in sound]).findings[0]
    assert fault in (finding.fault, *finding.rivals) and "camera_latency" not in finding.rivals


@pytest.mark.first_case
@pytest.mark.parametrize(("times", "may_be"), [(35.15, "57.3 (deg)"), (1.0 / 700.0, "1000 (mN m, N mm, mrad)")])
def test_a_ratio_of_torques_and_angles_is_told_as_it_is_and_no_unit_is_put_in_its_place(sound, times, may_be):
    runs = [mixed("torque", -np.eye(2) / times)(one) for one in sound]
    checked = check(MODEL, runs)
    sign, unit = sorted(checked.findings, key=lambda finding: finding.fault)
    assert (sign.fault, unit.fault) == ("torque_sign", "wrong_unit") and not unit.repairs
    ratio, said = max(times, 1.0 / times), re.search(r"about (\d+) times too (\w+)", unit.what)
    assert float(said[1]) == pytest.approx(ratio, rel=0.1) and said[2] == ("small" if times > 1.0 else "large")
    assert may_be in unit.what and "no unit" in unit.what
    for before, after in zip(runs, checked.repaired, strict=True):
        assert np.array_equal(after.channels["torque"].values, -before.channels["torque"].values)


@pytest.mark.slow
def test_a_ratio_that_no_known_unit_comes_near_is_said_to_be_none(sound):
    (finding,) = check(MODEL, [mixed("torque", 2e4 * np.eye(2))(one) for one in sound]).findings
    assert "20000 times too large" in finding.what and "no known unit" in finding.what and not finding.repairs


@pytest.mark.first_case
@pytest.mark.parametrize("inertia", [0.4 * INERTIA, INERTIA, 2.5 * INERTIA])
def test_friction_and_another_inertia_are_no_mistake_of_the_data(inertia):
    assert not check(MODEL, [run(inertia, seed=seed) for seed in range(2)]).findings


def test_a_constant_torque_is_a_step_and_not_a_dead_channel(sound):
    old = sound[0].channels["torque"]
    step = replace(sound[0], channels=sound[0].channels | {
        "torque": replace(old, values=np.ones_like(old.values)),
        "encoder": replace(sound[0].channels["encoder"], values=np.column_stack([old.t * 50.0] * 2)),
    })
    assert not check(MODEL, [step]).findings


@pytest.mark.slow
def test_explain_blames_no_physics_for_a_torque_of_the_other_sense(sound):
    answer = di.explain(MODEL, [FAULTS["torque_sign"](one) for one in sound])
    assert answer.verdict == "data" and answer.data[0].fault == "torque_sign"


@kernel
def swing(xc, torque, weight, out):
    out[0] = xc[1]
    out[1] = (torque[0] - weight * np.sin(xc[0])) / INERTIA


@kernel
def from_below(xc, out):
    out[0] = xc[0]


@kernel
def upward(xc, out):
    out[0] = xc[1]


def arm(weight):
    """An arm of this weight times its length [N m]."""
    return OwnModel(Block(Spec(
        inputs={"torque": 1}, outputs={"wheel_angle": Output(1, from_below), "wheel_rate": Output(1, upward)},
        parameters={"weight": weight}, continuous_state=np.zeros(2), derivatives=swing,
    )))


def swings(seed, sense=1.0):
    """12 s of an arm of 0.3 N m under position control, nearly to the top and back."""
    t, random = 1e-3 * np.arange(12000), np.random.default_rng(seed)
    sines = zip((1.8, 0.9, 0.4), (0.23, 0.6, 1.3), random.uniform(0.0, 6.0, 3), strict=True)
    wish = np.minimum(t, 1.0) * sum(a * np.sin(2.0 * np.pi * f * t + phase) for a, f, phase in sines)
    return follows(wish, random, sense)


def sine(seed):
    """3 s of an arm that swings steadily, at 1 Hz."""
    return follows(np.sin(2.0 * np.pi * 1e-3 * np.arange(3000)), np.random.default_rng(seed))


def follows(wish, random, sense=1.0):
    """An arm of 0.3 N m under position control, told at 1 kHz where to be."""
    torque, theta, omega = np.zeros(len(wish)), np.zeros(len(wish)), 0.0
    for i in range(len(wish) - 1):
        pull = 0.3 * np.sin(theta[i])
        torque[i] = INERTIA * (200.0 * (wish[i] - theta[i]) - 25.0 * omega) + pull if i % 5 == 0 else torque[i - 1]
        omega += 1e-3 * (torque[i] * random.normal(1.0, 0.02) - pull) / INERTIA
        theta[i + 1] = theta[i] + 1e-3 * omega
    return of_arm(sense * torque, theta)


def of_arm(torque, theta):
    """A run of an arm that was simulated at 1 kHz, logged at 200 Hz with 0.2 mrad a count."""
    t, counted = 1e-3 * np.arange(0, len(theta), 5), 2e-4 * np.floor(theta[::5, None] / 2e-4)
    return Recording("own", channels={
        "torque": Channel(t, ("tau_1",), torque[::5, None], {}, 5e-3),
        "encoder": Channel(t, ("theta_1",), counted, {}, 5e-3),
    })


@pytest.mark.first_case
@pytest.mark.parametrize("believed", [0.3, 0.0, 0.6])
def test_a_torque_that_holds_a_weight_is_no_mistake_of_the_data(believed):
    assert not check(arm(believed), [swings(seed) for seed in (2, 3)]).findings


@pytest.mark.slow
def test_a_torque_of_the_other_sense_is_found_beside_a_weight():
    findings = check(arm(0.3), [swings(seed, -1.0) for seed in (2, 3)]).findings
    assert [finding.fault for finding in findings] == ["torque_sign"]


def steps(seed, delay_s, sense=1.0):
    """3 s of an arm that jumps from place to place, and whose torque acts late."""
    t, random = 1e-3 * np.arange(3000), np.random.default_rng(seed)
    wish = random.uniform(-1.0, 1.0, 4)[(t / 0.8).astype(int)]
    late, torque, theta, omega, summed = round(delay_s / 1e-3), np.zeros(len(t)), np.zeros(len(t)), 0.0, 0.0
    for i in range(len(t) - 1):
        if i % 5 == 0:
            summed += 5e-3 * (wish[i] - theta[i])
            torque[i] = INERTIA * (240.0 * (wish[i] - theta[i]) - 18.0 * omega + 80.0 * summed)
        else:
            torque[i] = torque[i - 1]
        acts = torque[i - late] if i >= late else 0.0
        omega += 1e-3 * (acts * random.normal(1.0, 0.02) - 0.3 * np.sin(theta[i])) / INERTIA
        theta[i + 1] = theta[i] + 1e-3 * omega
    return of_arm(sense * torque, theta)


@pytest.mark.first_case
@pytest.mark.parametrize("seed", [0, 10])
def test_a_torque_that_acts_late_is_not_of_the_other_sense(seed):
    assert not check(arm(0.3), [steps(seed + k, 0.02) for k in (0, 1)]).findings


@pytest.mark.slow
def test_a_late_torque_of_the_other_sense_is_found():
    findings = check(arm(0.3), [steps(k, 0.02, -1.0) for k in (0, 1)]).findings
    assert [finding.fault for finding in findings] == ["torque_sign"]


@pytest.mark.first_case
@pytest.mark.parametrize("seed", range(3))
def test_a_torque_that_tells_nothing_at_most_lags_is_of_no_other_run(seed):
    assert not check(arm(0.3), [sine(seed + k) for k in (0, 3)]).findings


@pytest.mark.parametrize("channel", ["torque", "encoder"])
def test_what_is_no_number_is_refused(channel, sound):
    old = sound[0].channels[channel]
    values = old.values.copy()
    values[300, 1] = np.nan
    spoilt = replace(sound[0], channels=sound[0].channels | {channel: replace(old, values=values)})
    with pytest.raises(InputError, match=f"run 2: channel {channel}: sample 301: .* is nan, expected a finite number"):
        check(MODEL, [sound[1], spoilt])


@pytest.mark.slow
def test_runs_of_which_nothing_is_left_contradict_each_other(sound):
    def dead(recording):
        old = recording.channels["torque"]
        values = old.values.copy()
        values[1200:] = values[1200]
        return replace(recording, channels=recording.channels | {"torque": replace(old, values=values)})

    answer = di.explain(MODEL, [dead(one) for one in sound])
    assert answer.verdict == "data" and {finding.fault for finding in answer.data} == {"channel_frozen"}


def logged(torque, theta):
    """A run of two wheels that do the same, logged at 500 Hz with 6 mrad a count."""
    t, counted = 2e-3 * np.arange(len(theta)), 6e-3 * np.floor(theta / 6e-3)
    return Recording("two", channels={
        "torque": Channel(t, ("tau_1", "tau_2"), np.column_stack([torque, torque]), {}, 2e-3),
        "encoder": Channel(t, ("theta_1", "theta_2"), np.column_stack([counted, counted]), {}, 2e-3),
    })


_COUNTS = np.cumsum(np.tile(np.r_[np.ones(40), -np.ones(38), -2.0, np.ones(40), 2.0, -np.ones(42)], 25))[:4000]


@pytest.mark.first_case
@pytest.mark.parametrize("angles", [
    0.3 * np.abs((1e-3 * np.arange(4000)) % 2.0 - 1.0),  # to and fro at 0.15 rad/s, a count every 20 rows
    3.0 * np.abs((1e-3 * np.arange(4000)) % 2.0 - 1.0),  # a count every other row
    6e-3 * (_COUNTS + 0.5),
], ids=["slow", "quick", "count by count"])
def test_a_wheel_that_comes_by_again_and_a_torque_that_is_repeated_are_no_rows_twice(angles):
    torque = np.tile(0.05 * np.sin(2.0 * np.pi * np.arange(500) / 500.0), 8)
    found = [finding.fault for finding in check(MODEL, [logged(torque, angles)]).findings]
    assert "rows_duplicated" not in found
