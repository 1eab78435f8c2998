"""Is a command that changes between its samples told from one that changes at them, and when did it change?"""

import numpy as np
import pytest
from scipy.signal import lfilter

import drake_ispace as di
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.command.drive import drive_of
from drake_ispace.explain.check.compare.command.moments import moment_findings
from drake_ispace.explain.check.compare.links import base_of
from drake_ispace.faults.repair import Clock, Restamped
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.robots.library import robots
from hidden import two_wheels

SOUND = {"encoder_hz": 20.0, "left_share": 0.0, "late_s": 0.0}
SLOW_DRIVES = [{"ramp_s2_m": 0.5}, {"ramp_s2_m": 0.25}, {"brake_s2_m": 0.25}]


def checked(seconds=30.0, **robot):
    """Two runs, and what is found in them."""
    runs = [two_wheels.drive(seed, seconds, **SOUND | robot) for seed in range(2)]
    return runs, check(two_wheels.model(), runs)


def explained(runs):
    """What is said of them by a library of what may happen to a command."""
    few = [di.effects()[name] for name in ("velocity_lag", "velocity_delay", "velocity_gain")]
    return di.explain(two_wheels.model(), runs, effects=few)


def changes_of(seed, seconds=30.0):
    """(c,) moments [s] at which the command of a run changes."""
    random, t = np.random.default_rng([seed, 77]), 1e-3 * np.arange(round(seconds * 1e3))
    commands = [two_wheels.wandering(random, t, *limits, 1e-3) for limits in ((0.1, 0.5), (-1.0, 1.0))]
    return np.unique(np.concatenate([t[np.flatnonzero(np.diff(values)) + 1] for values in commands]))


def errors_of(runs, found):
    """The RMS by which the moments of changes are wrong [s], as logged and as repaired."""
    assert [finding.fault for finding in found.findings] == ["command_moments"] * 2
    logged, repaired = [], []
    for seed, (run, again) in enumerate(zip(runs, found.repaired, strict=True)):
        true = changes_of(seed)
        before, after = run.channels["command"].t, again.channels["command"].t
        moved = np.flatnonzero(before != after)
        which = np.searchsorted(true, before[moved] + 1e-9) - 1
        logged.append(before[moved] - true[which])
        repaired.append(after[moved] - true[which])
    assert len(np.concatenate(repaired)) > 30
    return [np.sqrt(np.mean(np.concatenate(one) ** 2)) for one in (logged, repaired)]


@pytest.mark.first_case
@pytest.mark.parametrize("robot", [
    {"lag_s": 0.0}, {"lag_s": 0.05}, {"lag_s": 0.25, "others": {"delay_s": 0.07}}, {"lag_s": 0.0, "encoder_hz": 100.0},
], ids=["exact", "lag", "lag and delay", "fast"])
def test_changes_get_their_own_moments_whatever_the_drive_does_besides(robot):
    step_s = 1.0 / (SOUND | robot)["encoder_hz"]
    logged, repaired = errors_of(*checked(**robot))
    assert logged > 0.45 * step_s and repaired < max(0.1 * step_s, 0.0015)


@pytest.mark.first_case
@pytest.mark.parametrize("others", SLOW_DRIVES, ids=["ramp", "fast ramp", "brakes"])
def test_what_a_drive_takes_longer_for_larger_changes_is_no_part_of_their_moments(others):
    logged, repaired = errors_of(*checked(lag_s=0.0, others=others))
    assert repaired < 0.4 * logged


@pytest.mark.first_case
@pytest.mark.parametrize("robot", [
    {"lag_s": 0.0}, {"lag_s": 0.2}, {"lag_s": 0.03, "others": {"delay_s": 0.03}}, {"lag_s": 0.1, "encoder_hz": 100.0},
    {"lag_s": 0.1, "others": {"gain_share": 0.08}}, {"lag_s": 0.0, "others": {"brake_s2_m": 1.0}},
    {"lag_s": 0.0, "others": {"ramp_s2_m": 0.5}},
])
def test_a_command_that_changes_when_it_is_logged_is_sound(robot):
    assert checked(**robot, in_step=True)[1].findings == []


def lagging(seed, lag_s, until_logged_s=0.0):
    """Command and wheels of a drive that lags, and that errs by 2 mm/s for some 0.3 s at a time.

    Its command changes so long before it is logged, or less.
    """
    random, step_s, wheels = np.random.default_rng(seed), 0.02, two_wheels.model().rover.plant.nominal_geometry
    t = TICK_S * np.arange(round(20.0 / TICK_S))
    at = np.cumsum(random.choice(np.arange(40, 125), 12)) * step_s
    acts, size = at - until_logged_s * random.random(len(at)), random.uniform(-0.2, 0.2, len(at))
    speed = (t[:, None] >= acts) @ size
    told = np.column_stack([speed, 0.0 * t, np.sin(3.0 * speed)])
    keep, alike = np.exp(-TICK_S / np.array([lag_s, 0.3]))
    erred = lfilter([np.sqrt(1.0 - alike**2)], [1.0, -alike], random.normal(0.0, 0.002, len(t)))
    speeds = lfilter([0.0, 1.0 - keep], [1.0, -keep], told, axis=0) + erred[:, None] * [1.0, 0.0, 3.0]
    count = 2.0 * np.pi / 4096
    angles = np.floor(np.cumsum(TICK_S * speeds @ wheels.inverse.T, axis=0) / count) * count
    every = round(step_s / TICK_S)
    command = Channel(t[::every], ("vx", "vy", "wz"), told[::every], {}, step_s)
    names = tuple(f"theta_{i + 1}" for i in range(angles.shape[1]))
    run = Recording("rover", "velocity_base", {"encoder": Channel(t[::every], names, angles[::every], {}, step_s)})
    model = two_wheels.model()
    return drive_of(command, base_of(run, robots()["rover"], model.rover))


@pytest.mark.parametrize("seed", [1, 4, 7])
def test_a_lagging_drive_that_is_too_fast_for_a_while_makes_no_moments(seed):
    assert not moment_findings({i: lagging(10 * seed + i, 0.25) for i in range(3)})


def test_moments_are_told_beside_a_drive_that_is_too_fast_for_a_while():
    assert moment_findings({i: lagging(i, 0.25, 0.02) for i in range(3)})


@pytest.mark.slow
def test_changes_are_found_though_the_drive_speeds_up_slowly():
    _, found = checked(lag_s=0.0, others={"ramp_s2_m": 0.3}, encoder_hz=50.0)
    assert [finding.fault for finding in found.findings] == ["command_moments"] * 2


def test_a_log_without_any_noise_whose_command_has_few_speeds_is_sound():
    model, t = two_wheels.model(), 0.05 * np.arange(400)
    speeds = np.array([0.0, 0.2, 0.4, 0.6, 0.4])[np.arange(400) // 24 % 5]
    command = np.column_stack([speeds, np.zeros(400), np.where(np.arange(400) // 40 % 2, 0.4, -0.4)])
    rates = command @ model.rover.plant.nominal_geometry.inverse.T
    angles = np.vstack([np.zeros(2), np.cumsum(0.05 * rates[:-1], axis=0)])
    phi = np.concatenate([[0.0], np.cumsum(0.05 * command[:-1, 2])])
    way = np.vstack([np.zeros(2), np.cumsum(np.column_stack([
        0.05 * command[:-1, 0] * np.sinc(0.025 * command[:-1, 2] / np.pi) * f(phi[:-1] + 0.025 * command[:-1, 2])
        for f in (np.cos, np.sin)
    ]), axis=0)])
    run = Recording("mine", "velocity_base", {
        "command": Channel(t, ("vx", "vy", "wz"), command, {}, 0.05),
        "encoder": Channel(t, ("theta_1", "theta_2"), angles, {}, 0.05),
        "kinect": Channel(t[1::2], ("x", "y", "phi"), np.column_stack([way, phi])[1::2], {}, None),
    })
    assert "command_moments" not in {finding.fault for finding in check(model, [run]).findings}


@pytest.mark.slow
def test_a_robot_without_lag_lacks_nothing_although_its_command_changes_between_samples():
    runs, _ = checked(15.0, lag_s=0.0)
    answer = explained(runs)
    assert answer.verdict == "none" and {finding.fault for finding in answer.data} == {"command_moments"}


@pytest.mark.slow
def test_a_lag_is_not_short_by_half_a_sample():
    runs, _ = checked(15.0, lag_s=0.05)
    answer = explained(runs)
    assert [effect.name for effect in answer.effects] == ["velocity_lag"]
    driving, extra = (answer.effects[0].parameters[name] for name in ("time_constant_s", "turning_extra_s"))
    assert driving.estimate + extra.estimate == pytest.approx(0.05, abs=0.003)  # which these runs know best
    assert driving.ci90[0] < 0.05 < driving.ci90[1] and driving.estimate == pytest.approx(0.05, abs=0.006)


def test_samples_at_earlier_times_stay_in_order():
    command = Channel(np.array([0.0, 0.1, 0.2, 0.3]), ("vx",), np.arange(4.0)[:, None])
    repair = Restamped("command", (1, 3), (0.04, 0.1))
    again = repair.apply(Recording("mine", "velocity_base", {"command": command}, "")).channels["command"]
    assert again.t == pytest.approx([0.0, 0.06, 0.2]) and again.values[:, 0] == pytest.approx([0.0, 1.0, 2.0])


@pytest.mark.slow
def test_a_log_that_keeps_every_fourth_sample_of_the_command_shows_no_delay():
    run = two_wheels.drive(5, **SOUND | {"lag_s": 0.0, "in_step": True})
    command = run.channels["command"]
    rare = Channel(command.t[::4], command.columns, command.values[::4], {}, None)
    answer = explained([Recording(run.robot, run.scenario, run.channels | {"command": rare})])
    assert answer.verdict == "none" and {finding.fault for finding in answer.data} == {"command_moments"}


def test_a_command_that_no_wheel_answers_in_time_has_no_moments():
    runs = [two_wheels.drive(seed, 12.0, left_share=0.0, late_s=0.0, lag_s=0.0) for seed in (500, 501, 502)]
    late = [Clock("command", 1.0, 0.1).apply(run) for run in runs]
    assert check(two_wheels.model(), late).findings == []
