"""Odometry: pose from wheel angles, and what leaning of the pendulum does to it."""

import numpy as np
import pytest

from drake_ispace.control.estimate.odometry import OmniOdometry, PendulumOdometry
from drake_ispace.plants.wheels import omni3, omni4

R, B = 0.024, 0.36  # omni: wheel radius and distance between opposite wheels
RADIUS, HALF_TRACK = 0.08, 0.2  # pendulum


def omni_ticks(motion, count, geometry=None, first=0.0):
    """Encoder messages for a body displacement `motion` per tick."""
    inverse = (geometry or omni4(R, B)).inverse
    change = inverse @ motion
    return [{"encoder": [k, *(first + k * change), *(change / 0.005)]} for k in range(count + 1)]


def pendulum_ticks(right, left, tilt, count):
    """Wheel and tilt angles that change evenly from zero (tilt: from zero to `tilt`)."""
    share = np.arange(count + 1) / count
    return [
        {"encoder": [k, right * f, left * f, 0.0, 0.0], "tilt": [k, tilt * f, 0.0, 0.0]} for k, f in enumerate(share)
    ]


def test_before_the_first_sample_it_is_where_it_was_told_to_be(drive):
    block = OmniOdometry(omni4(R, B), [0.1, 0.2, 0.3])
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, np.array([-1.0, *np.zeros(8)]))
    assert list(block.GetOutputPort("pose").Eval(context)) == [-1.0, 0.1, 0.2, 0.3]


def test_wheel_angles_at_the_start_do_not_count(drive):
    rows = drive(OmniOdometry(omni4(R, B)), "pose", omni_ticks([0.0, 0.0, 0.0], 3, first=5.0))
    assert not rows[:, 1:].any()


def test_straight_along_the_heading(drive):
    rows = drive(OmniOdometry(omni4(R, B), [0.0, 0.0, np.pi / 6.0]), "pose", omni_ticks([0.001, 0.0, 0.0], 500))
    assert rows[-1] == pytest.approx([500, 0.5 * np.sqrt(0.75), 0.25, np.pi / 6.0], abs=1e-12)


def test_sideways(drive):
    rows = drive(OmniOdometry(omni4(R, B), [0.0, 0.0, np.pi / 2.0]), "pose", omni_ticks([0.0, 0.001, 0.0], 500))
    assert rows[-1, 1:] == pytest.approx([-0.5, 0.0, np.pi / 2.0], abs=1e-12)


def test_turning_in_place_is_exact_and_not_wrapped(drive):
    rows = drive(OmniOdometry(omni4(R, B), [0.1, 0.2, 0.0]), "pose", omni_ticks([0.0, 0.0, 0.01], 1000))
    assert rows[-1, 1:] == pytest.approx([0.1, 0.2, 10.0], abs=1e-12)


@pytest.mark.parametrize("geometry", [omni4(R, B), omni3(R, 0.18)], ids=["4 wheels", "3 wheels"])
def test_a_circle_closes_and_is_as_wide_as_its_chords(drive, geometry):
    turn, arc = 2.0 * np.pi / 400, 0.6 * 2.0 * np.pi / 400
    rows = drive(OmniOdometry(geometry), "pose", omni_ticks([arc, 0.0, turn], 400, geometry))
    assert rows[-1, 1:] == pytest.approx([0.0, 0.0, 2.0 * np.pi], abs=1e-11)
    # chords as long as their arcs, along their true direction: too wide by turn^2 / 24 = 1e-5
    assert np.ptp(rows[:, 2]) == pytest.approx(1.2 * (1.0 + turn**2 / 24.0), abs=1e-9)


def test_body_velocity_by_hand(drive):
    # (2.66): all wheels at 1 rad/s turn the robot at r / (b / 2) = 0.1333 rad/s
    ticks = [{"encoder": [0, 0, 0, 0, 0, 1.0, 1.0, 1.0, 1.0]}]
    velocity = drive(OmniOdometry(omni4(R, B)), "body_velocity", ticks)[0]
    assert velocity == pytest.approx([0.0, 0.0, 0.024 / 0.18], abs=1e-15)


def test_both_wheels_of_the_pendulum_drive_it_straight(drive):
    block = PendulumOdometry(RADIUS, HALF_TRACK, [0.0, 0.0, np.pi / 2.0])
    ticks = pendulum_ticks(5.0, 5.0, 0.0, 50)
    assert drive(block, "pose", ticks)[-1] == pytest.approx([50, 0.0, 0.4, np.pi / 2.0], abs=1e-12)
    assert drive(block, "path", ticks)[-1] == pytest.approx([50, 0.4, np.pi / 2.0])


def test_opposite_wheels_turn_the_pendulum_in_place(drive):
    rows = drive(PendulumOdometry(RADIUS, HALF_TRACK), "pose", pendulum_ticks(5.0, -5.0, 0.0, 50))
    assert rows[-1, 1:] == pytest.approx([0.0, 0.0, 5.0 * 0.08 / 0.2], abs=1e-12)


def test_a_quarter_arc_of_the_pendulum(drive):
    # radius 0.5: the outer wheel rolls 0.7 pi / 2, the inner one 0.3 pi / 2
    right, left = 0.7 * np.pi / 2.0 / RADIUS, 0.3 * np.pi / 2.0 / RADIUS
    rows = drive(PendulumOdometry(RADIUS, HALF_TRACK), "pose", pendulum_ticks(right, left, 0.0, 400))
    assert rows[-1, 1:] == pytest.approx([0.5, 0.5, np.pi / 2.0], abs=1e-6)


def test_rocking_in_place_is_no_driving(drive):
    # wheels stand on the floor, so relative to the body they turn back by its tilt
    ticks = pendulum_ticks(-0.1, -0.1, 0.1, 20)
    assert drive(PendulumOdometry(RADIUS, HALF_TRACK), "path", ticks)[-1, 1] == pytest.approx(0.0, abs=1e-15)


def test_the_literatures_odometry_takes_rocking_for_driving(drive):
    ticks = pendulum_ticks(-0.1, -0.1, 0.1, 20)
    path = drive(PendulumOdometry(RADIUS, HALF_TRACK, body_share=0.0), "path", ticks)
    assert path[-1, 1] == pytest.approx(-0.08 * 0.1, abs=1e-12)  # r times tilt: 8 mm


def test_velocity_of_the_pendulum_counts_the_body_too(drive):
    ticks = [{"encoder": [0, 0.0, 0.0, 3.0, 1.0], "tilt": [0, 0.0, 0.5, 0.0]}]
    # 0.04 (3 + 1 + 2 * 0.5) and 0.2 (3 - 1)
    assert drive(PendulumOdometry(RADIUS, HALF_TRACK), "velocity", ticks)[0] == pytest.approx([0.2, 0.4])
