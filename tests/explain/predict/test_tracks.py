"""A run on ticks begins where its sensors do, and ends with the first of them."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.predict.case import prepare
from drake_ispace.faults.repair import rows
from hidden import two_wheels


@pytest.fixture(scope="module")
def recording():
    return two_wheels.drive(70, 6.0)


def track_of(recording, **channels):
    """The Track of the recording with some channels changed."""
    (track,) = prepare(two_wheels.model(), replace(recording, channels=recording.channels | channels)).prediction.tracks
    return track


def test_a_run_begins_with_its_encoder(recording):
    encoder, whole = recording.channels["encoder"], track_of(recording)
    late = track_of(recording, encoder=rows(encoder, encoder.t >= 2.0))
    assert late.ticks == whole.ticks - 400 and np.array_equal(late.measured[0], whole.measured[400])
    assert late.fix_t[0] < 1.0 / 30.0 and len(late.seen) == np.sum(whole.seen[:, 0] >= 2.0)
    assert (whole.since_s, late.since_s) == (0.0, 2.0)


def test_that_the_begin_is_not_used_is_said(recording):
    encoder = recording.channels["encoder"]
    late = replace(recording, channels=recording.channels | {"encoder": rows(encoder, encoder.t >= 2.0)})
    assert "the first 2 s are not used" in prepare(two_wheels.model(), late).warning
    assert prepare(two_wheels.model(), recording).warning == ""


def test_an_encoder_that_begins_within_a_step_cuts_nothing(recording):
    encoder = recording.channels["encoder"]
    assert track_of(recording, encoder=rows(encoder, encoder.t > 0.0)).since_s == 0.0


def test_what_was_told_before_is_in_force(recording):
    encoder, command = recording.channels["encoder"], recording.channels["command"]
    told = replace(command, t=np.array([0.0, 3.0]), values=np.array([[0.1, 0.0, 0.2], [0.2, 0.0, 0.0]]), period_s=None)
    late = track_of(recording, encoder=rows(encoder, encoder.t >= 2.0), command=told)
    assert late.command[0] == pytest.approx([0.1, 0.0, 0.2]) and late.command[-1] == pytest.approx([0.2, 0.0, 0.0])


def test_a_camera_that_begins_late_or_ends_early_has_lost_no_fix(recording):
    kinect = replace(recording.channels["kinect"], period_s=1.0 / 30.0)
    gaps = rows(kinect, (kinect.t < 3.0) & ((kinect.t < 1.0) | (kinect.t > 2.0)))
    assert track_of(recording, kinect=rows(kinect, abs(kinect.t - 3.0) < 1.0)).missed.sum() == 0
    assert track_of(recording, kinect=gaps).missed.sum() == pytest.approx(30, abs=1)


@pytest.mark.parametrize("changed", [
    lambda t: np.round(t, 3), lambda t: t + np.random.default_rng(3).uniform(-0.2, 0.2, len(t)) / 30.0,
], ids=["milliseconds", "uneven"])
def test_only_lost_fixes_are_missed_where_stamps_are_rounded_or_uneven(recording, changed):
    kinect = recording.channels["kinect"]
    stamped = replace(kinect, t=changed(kinect.t + 0.01), period_s=0.033)
    kept = np.ones(len(kinect.t), bool)
    kept[[20, 50, 51, 90]] = False
    assert track_of(recording, kinect=stamped).missed.sum() == 0
    assert track_of(recording, kinect=rows(stamped, kept)).missed.sum() == 4


def test_a_fix_that_is_late_is_of_the_capture_before(recording):
    kinect = recording.channels["kinect"]
    late = np.arange(len(kinect.t)) == 40
    stamped = replace(kinect, t=kinect.t + 0.02 * late, period_s=0.033)
    assert track_of(recording, kinect=stamped).missed.sum() == 0
    kept = np.arange(len(kinect.t)) != 60
    missed = track_of(recording, kinect=rows(stamped, kept)).missed
    assert missed.sum() == 1 and missed[60]


def test_fixes_stamped_when_they_arrive_at_any_time_count_no_captures(recording):
    kinect = recording.channels["kinect"]
    late = np.sort(kinect.t + np.random.default_rng(3).uniform(0.0, 2.0, len(kinect.t)) / 30.0)
    late += 1e-6 * np.arange(len(late))
    assert track_of(recording, kinect=replace(kinect, t=late, period_s=0.03)).missed.size == 0
