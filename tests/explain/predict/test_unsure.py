"""At which changes of a command is the moment unknown? Where a check has moved it between the steps of its log."""

import numpy as np
import pytest

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.predict.stretches import stretch
from drake_ispace.explain.predict.tracks import track
from drake_ispace.faults.repair import Restamped
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.robots.rover import Rover
from hidden import two_wheels

STEP_S, CHANGED = 0.02, (40, 80, 81, 150)
EARLIER = (0.013, 0.004, 0.017, 0.009)
SPEED = 0.1


def recorded(t=None, values=None):
    """Six seconds of a command that changes at a few samples."""
    t = STEP_S * np.arange(300) if t is None else t
    values = SPEED * np.searchsorted(CHANGED, np.arange(len(t)), side="right") if values is None else values
    command = np.column_stack([values, np.zeros((len(t), 2))])
    encoder = two_wheels.drive(1, 6.0).channels["encoder"]
    return Recording("mine", "velocity_base", {
        "command": Channel(t, ("vx", "vy", "wz"), command, {}, None), "encoder": encoder,
    })


def on_ticks(recording):
    return track(recording, Rover(), two_wheels.model().rover.plant, "a run")


def repaired(earlier=EARLIER):
    return Restamped("command", CHANGED, earlier).apply(recorded())


@pytest.mark.parametrize("earlier", [EARLIER, (0.0, *EARLIER[1:])], ids=["moved", "one at its sample"])
def test_where_changes_were_moved_each_is_unsure_by_the_spread_within_a_step(earlier):
    unsure = on_ticks(repaired(earlier)).unsure
    ticks = np.flatnonzero(unsure.any(axis=1))
    moments = STEP_S * np.array(CHANGED) - earlier
    assert np.all((TICK_S * ticks <= moments) & (moments <= TICK_S * (ticks + 1) + 1e-9))
    assert unsure[ticks, 0] == pytest.approx(SPEED * STEP_S / np.sqrt(12.0) / TICK_S)


def test_a_change_at_a_sample_is_sure():
    assert on_ticks(recorded()).unsure is None


@pytest.mark.parametrize("share", [0.01, 0.02, 0.05, 0.2])
def test_stamps_that_jitter_are_no_sign_of_a_change_between_them(share):
    jitter = share * STEP_S * np.random.default_rng(3).uniform(-1.0, 1.0, 300)
    assert on_ticks(recorded(np.maximum(STEP_S * np.arange(300) + jitter, 0.0))).unsure is None


def test_events_that_are_logged_beside_even_samples_are_sure():
    even, events = 0.1 * np.arange(60), np.array([1.03, 2.47, 3.86])
    t = np.sort(np.concatenate([even, events]))
    assert on_ticks(recorded(t, np.searchsorted(events, t, side="right").astype(float))).unsure is None


def test_a_change_after_lost_samples_is_sure():
    kept = np.delete(np.arange(300), np.arange(60, 80))
    whole = recorded().channels["command"]
    assert on_ticks(recorded(whole.t[kept], whole.values[kept, 0])).unsure is None


def test_what_is_unsure_goes_with_its_ticks():
    whole = on_ticks(repaired())
    part = stretch(whole, 200, 900, 0)
    assert np.array_equal(part.unsure, whole.unsure[200 : 200 + len(part.unsure)]) and part.unsure.any()
    sooner = whole.earlier("command", 7)
    assert np.array_equal(sooner.unsure[:500], whole.unsure[7:507])
