"""Cards of faults, and repairs that undo them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drake_ispace.effects.library import library
from drake_ispace.faults.library import FAULTS, same_as
from drake_ispace.faults.repair import (
    AlongRobot,
    Clock,
    CutOut,
    Dropped,
    Evened,
    Gridded,
    Mirrored,
    Mixed,
    Unwrapped,
    Without,
    parts,
    time_text,
    with_channel,
)
from drake_ispace.files.recording import Channel, Recording

T = 0.1 * np.arange(10)


@pytest.fixture
def run():
    wheels = Channel(T, ("theta_r", "theta_l"), np.column_stack([T, 2.0 * T]))
    return Recording("pendulum", None, {"encoder": wheels, "kinect": Channel(T, ("x", "y", "phi"), np.zeros((10, 3)))})


def test_every_card_is_complete_and_refers_to_what_there_is():
    for name, fault in FAULTS.items():
        assert name == fault.name and all(vars(fault)[part] for part in ("title", "does", "cause", "shows", "repair"))
        assert set(fault.same) <= FAULTS.keys() - {name} and set(fault.effects) <= library().keys()


def test_a_late_camera_is_the_same_as_a_clock_that_is_off():
    assert same_as("camera_latency") == ["clock_offset"] and same_as("mass_error") == []


def test_signs_units_and_order_are_a_matrix(run):
    repair = Mixed("encoder", ("theta_r", "theta_l"), ((0.0, -1.0), (1000.0, 0.0)))
    repaired = repair.apply(run).channels["encoder"].values
    assert np.allclose(repaired, np.column_stack([-2.0 * T, 1000.0 * T]))
    assert str(repair) == "encoder: theta_r = -theta_l, theta_l = 1000 theta_r"


def test_a_velocity_along_the_room_is_turned_by_the_headings():
    seen = np.column_stack([T, T, np.mod(np.pi / 2.0 + T + np.pi, 2.0 * np.pi) - np.pi])
    told = Channel(np.array([0.0, 0.1, 0.4]), ("vx", "vy", "wz"), np.tile([1.0, 0.0, 0.5], (3, 1)))
    run = Recording("mine", None, {"command": told, "kinect": Channel(T, ("x", "y", "phi"), seen)})
    turned = AlongRobot("command", "kinect").apply(run).channels["command"]
    assert np.allclose(turned.t, [0.0, 0.1, 0.2, 0.3, 0.4])  # what is held for longer is turned anew
    phi = np.pi / 2.0 + np.array([0.05, 0.15, 0.25, 0.35, 0.4])
    assert np.allclose(turned.values, np.column_stack([np.cos(phi), -np.sin(phi), np.full(5, 0.5)]))


def test_without_a_camera_no_velocity_is_turned(run):
    assert AlongRobot("encoder", "imu").apply(run) is run


def test_a_counter_goes_on_where_it_started_anew(run):
    wrapped = run.channels["encoder"].values % 1.0
    run.channels["encoder"] = Channel(T, ("theta_r", "theta_l"), wrapped)
    repaired = Unwrapped("encoder", ("theta_r", "theta_l"), 1.0).apply(run).channels["encoder"].values
    assert np.allclose(repaired, np.column_stack([T, 2.0 * T]))


def test_a_clock_is_shifted_and_stretched(run):
    assert np.allclose(Clock("encoder", 1e-3, 0.5).apply(run).channels["encoder"].t, 1e-3 * T + 0.5)
    even = with_channel(run, "encoder", replace(run.channels["encoder"], period_s=0.1))
    assert Clock("encoder", 1.01, 0.0).apply(even).channels["encoder"].period_s == pytest.approx(0.101)
    assert Clock("encoder", 1e-3, 0.0).apply(even).channels["encoder"].period_s is None
    assert str(Clock("encoder", 1.0, -0.25, 3.0)) == "encoder: t = t - 0.25 s from 3 s on"


def test_a_clock_that_counts_from_1970_is_told_to_a_microsecond():
    repair = Clock("encoder", np.float64(0.99831527412345), 2864034.123456, 1.7e9 + 0.25)
    assert str(repair) == "encoder: t = 0.99831527412345 t + 2864034.123456 s from 1700000000.25 s on"
    assert str(Dropped("imu", 1.7e9, 1.7e9 + 2.5)) == "imu: samples from 1700000000 s to 1700000002.5 s left out"


def test_a_rate_without_an_offset_says_so():
    assert str(Clock("encoder", 0.998, 1e-9)) == "encoder: t = 0.998 t"


def test_a_time_just_before_zero_has_no_sign():
    assert time_text(-1e-7) == "0" and time_text(-0.0004, 3) == "0"


def test_a_clock_set_back_leaves_no_sample_before_another(run):
    t = Clock("encoder", 1.0, -0.35, 0.5).apply(run).channels["encoder"].t
    assert np.all(np.diff(t) > 0.0) and len(t) < len(T)


def test_rows_are_left_out_turned_round_and_spread(run):
    assert len(Dropped("encoder", 0.15, 0.35).apply(run).channels["encoder"].t) == 8
    turned = Mirrored("encoder", 0.2, 0.4).apply(run).channels["encoder"].values[:, 0]
    assert np.allclose(turned[2:5], T[4:1:-1])
    run.channels["encoder"] = Channel(T**2, ("theta_r", "theta_l"), np.zeros((10, 2)))
    assert np.allclose(np.diff(Evened("encoder").apply(run).channels["encoder"].t), 0.09)
    assert set(Without("kinect").apply(run).channels) == {"encoder"}


@pytest.mark.parametrize("repair", [Evened("kinect"), Gridded("kinect", 0.1, 0.02), Mirrored("kinect", 0.2, 0.6)])
def test_no_fix_of_a_repaired_camera_is_received_before_its_stamp(run, repair):
    values = np.column_stack([T, T, T, T**2 + 0.001])
    run.channels["kinect"] = Channel(T**2, ("x", "y", "phi", "t_received"), values)
    repaired = repair.apply(run).channels["kinect"]
    assert np.all(repaired.column("t_received") >= repaired.t)
    assert np.all(np.diff(repaired.column("t_received")) > 0.0)


def test_stamps_go_to_the_nearest_free_step(run):
    t = np.array([0.02, 0.13, 0.14, 0.38, 0.52])
    run.channels["encoder"] = Channel(t, ("theta_r", "theta_l"), np.zeros((5, 2)))
    repair = Gridded("encoder", 0.1, 0.0)
    assert repair.apply(run).channels["encoder"].t == pytest.approx([0.0, 0.1, 0.2, 0.4, 0.5])
    assert str(repair) == "encoder: stamps at 0 s and multiples of 0.1 s after it"


def test_a_run_is_cut_into_the_parts_that_are_long_enough(run):
    first, second = parts(run, [CutOut(0.35, 0.45)], 0.2)
    assert first.channels["encoder"].t[-1] == T[3] and second.channels["kinect"].t[0] == T[5]
    assert len(parts(run, [CutOut(0.05, 0.45)], 0.2)) == 1


def test_the_page_has_every_card():
    page = (Path(__file__).parents[2] / "docs" / "faults.md").read_text(encoding="utf-8")
    for fault in FAULTS.values():
        row = next(line for line in page.splitlines() if line.startswith(f"| `{fault.name}` |"))
        assert all(text in row for text in (fault.does, fault.cause, fault.shows, fault.repair))
