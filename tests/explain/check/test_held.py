"""Are samples that a table holds until the next one told from samples that are the same by rights?"""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.sampling.held import held_samples
from drake_ispace.files.recording import Channel, Recording
from hidden import two_wheels

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}


def with_samples(run, name, t, values):
    channel = replace(run.channels[name], t=t, values=values, period_s=None)
    return replace(run, channels=run.channels | {name: channel})


def held(run, name, every_s):
    """The run with the channel in a table that has a row every so often, in which the last sample stands."""
    channel = run.channels[name]
    t = np.arange(channel.t[0], channel.t[-1], every_s)
    return with_samples(run, name, t, channel.values[np.searchsorted(channel.t, t + 1e-9, side="right") - 1])


def thinned(run, every):
    encoder = run.channels["encoder"]
    return with_samples(run, "encoder", encoder.t[::every], encoder.values[::every])


@pytest.fixture(scope="module")
def run():
    return two_wheels.drive(3, 20.0, **SOUND)


def test_fixes_that_stand_in_a_table_until_the_next_one_are_left_out(run):
    in_a_table = held(run, "kinect", 0.01)
    findings = {f.fault: f for f in check(two_wheels.model(), [in_a_table]).findings}
    assert set(findings) == {"samples_held", "stamp_jitter"}  # in steps of a row, fixes are no longer even
    (repair,) = findings["samples_held"].repairs
    before, after = run.channels["kinect"], repair.apply(in_a_table).channels["kinect"]
    assert len(after.t) == pytest.approx(len(before.t), abs=2) and np.isin(after.values, before.values).all()
    late = after.t - before.t[np.searchsorted(before.t, after.t + 1e-9) - 1]
    assert -1e-9 < late.min() and late.max() < 0.01 + 1e-9


def test_an_encoder_that_is_logged_twice_as_often_as_it_is_read_is_as_if_it_were_not(run):
    slow = thinned(run, 2)
    checked = check(two_wheels.model(), [held(slow, "encoder", 0.02)])
    assert [(f.fault, f.channel) for f in checked.findings] == [("samples_held", "encoder")]
    after, read = checked.repaired[0].channels["encoder"], slow.channels["encoder"]
    assert after.t == pytest.approx(read.t[: len(after.t)]) and len(after.t) > len(read.t) - 3
    assert (after.values == read.values[: len(after.t)]).all()


def test_a_wheel_that_turns_slowly_between_counts_is_sound():
    t = 0.005 * np.arange(4000)
    slow = np.floor(np.cumsum(0.3 + 0.2 * np.sin(t)))  # 0.1 to 0.5 counts from row to row
    encoder = Channel(t, ("theta_1", "theta_2"), np.column_stack([slow, slow]))
    assert list(held_samples(Recording("mine", channels={"encoder": encoder}))) == []


@pytest.mark.parametrize("read_hz", [60.0, 40.0, 12.0])
def test_an_encoder_in_a_table_of_any_other_rate_loses_what_is_old(read_hz):
    t = np.arange(0.0, 20.0, 0.01)
    read_s = np.floor(t * read_hz + 1e-9) / read_hz
    angle = np.floor(3000.0 * (read_s + np.sin(0.5 * read_s)))
    encoder = Channel(t, ("theta_1", "theta_2"), np.column_stack([angle, 1.1 * angle]))
    (finding,) = held_samples(Recording("mine", channels={"encoder": encoder}))
    left_out, old = np.array(finding.repairs[0].samples), np.flatnonzero(np.diff(read_s) == 0.0) + 1
    assert np.isin(left_out, old).all() and len(left_out) > 0.95 * len(old)


@pytest.mark.parametrize("rate", [
    np.where(np.arange(600) % 4 < 3, 3.0, 0.0), np.where(np.arange(600) % 30 < 15, 3.0, 0.0), np.full(600, 0.7),
], ids=["a row of rest", "stop and go", "slow"])
def test_a_wheel_that_rests_or_creeps_is_sound(rate):
    angle = np.floor(20.0 * np.cumsum(rate * 0.1)) / 20.0
    encoder = Channel(0.1 * np.arange(600), ("theta_1", "theta_2"), np.column_stack([angle, angle]))
    assert list(held_samples(Recording("mine", channels={"encoder": encoder}))) == []


def test_held_samples_are_the_same_rows_whatever_else_is_left_out(run):
    in_a_table = held(thinned(run, 2), "encoder", 0.02)
    encoder = in_a_table.channels["encoder"]
    values = encoder.values.copy()
    values[400:460] = values[200:260]
    checked = check(two_wheels.model(), [with_samples(in_a_table, "encoder", encoder.t, values)])
    assert {"samples_held", "rows_duplicated"} <= {finding.fault for finding in checked.findings}
    ((masked,),) = checked.masked([with_samples(in_a_table, "encoder", encoder.t, values)])
    assert masked.channels["encoder"].t == pytest.approx(checked.repaired[0].channels["encoder"].t)


def test_a_camera_that_rounds_places_to_more_than_the_robot_moves_is_sound(run):
    kinect = run.channels["kinect"]
    coarse = np.column_stack([np.round(kinect.values[:, :2], 2), np.round(kinect.values[:, 2], 1)])
    findings = check(two_wheels.model(), [with_samples(run, "kinect", kinect.t, coarse)]).findings
    assert "samples_held" not in {finding.fault for finding in findings}


def test_an_encoder_may_be_read_more_rarely_than_the_command_is_logged(run):
    assert check(two_wheels.model(), [thinned(run, 2), thinned(two_wheels.drive(4, 20.0, **SOUND), 2)]).findings == []


@pytest.mark.slow
def test_a_sound_robot_lacks_nothing_although_its_fixes_are_held():
    runs = [held(two_wheels.drive(seed, 15.0, **SOUND), "kinect", 0.01) for seed in range(2)]
    answer = di.explain(two_wheels.model(), runs)
    assert answer.verdict == "none" and "samples_held" in {finding.fault for finding in answer.data}
