"""The way point: every kind of path, its speed, corners, laps, end, acceleration, and when it is renewed."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from drake_ispace.blocks.kernels import arguments
from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.control.guide.paths import Trajectory, build_path
from drake_ispace.control.guide.way_point import WayPoint, slide

X, Y, PHI, VX, VY, WZ, AX, AY, YAW_ACC = range(1, 10)


def way_points(trajectory, ticks, first=(0.0, 0.0)):
    """(len(ticks), 10) messages, as if the way point were renewed at each of these ticks."""
    spec = WayPoint(trajectory, build_path(trajectory, "trajectory"), first).spec
    values = [spec.parameters[name] for name in arguments(slide)[1:]]
    rows = np.empty((len(ticks), 10))
    for tick, row in zip(ticks, rows, strict=True):
        slide(int(tick), *values, row)
    return rows


def at(trajectory, time_s, **keywords):
    return way_points(trajectory, [ticks_in(time_s)], **keywords)[0]


def moving(**keywords):
    return Trajectory(start_s=0.0, **keywords)


LINE = {"kind": "line", "centre_m": [0.1, 0.2], "goal_m": [0.4, 0.6]}  # 0.5 m along (3, 4) / 5: 2 s at 0.25 m/s
POLYLINE = {"kind": "polyline", "points_m": [[0.0, 0.0], [0.5, 0.0], [0.5, -0.25]]}  # 3 s


def test_a_line_is_travelled_at_a_quarter_of_a_metre_a_second():
    row = at(moving(**LINE), 1.0)
    assert row[X : VY + 1] == pytest.approx([0.25, 0.4, 0.0, 0.15, 0.2], abs=1e-9)
    assert not row[WZ:].any()


@pytest.mark.parametrize("kind", ["line", "square", "circle", "figure_eight", "polyline"])
def test_every_path_is_travelled_at_its_speed(kind):
    options = {"line": LINE, "polyline": POLYLINE}.get(kind, {"kind": kind})
    trajectory = moving(**options, speed_m_s=0.4)
    ticks = np.arange(0, int(build_path(trajectory, "").length_m / 0.4 / TICK_S) - 1)
    rows = way_points(trajectory, ticks)
    steps = np.linalg.norm(np.diff(rows[:, X : Y + 1], axis=0), axis=1)
    assert np.median(steps) == pytest.approx(0.4 * TICK_S, rel=1e-5)
    assert steps.max() < 0.4 * TICK_S * (1.0 + 1e-5)  # less only where it cuts a corner
    assert np.linalg.norm(rows[:, VX : VY + 1], axis=1) == pytest.approx(np.full(len(rows), 0.4), rel=1e-4)


@pytest.mark.parametrize("kind", ["circle", "figure_eight"])
def test_rates_are_those_of_the_path(kind):
    rows = way_points(moving(kind=kind, heading="tangent"), np.arange(200, 900))
    inner, h = slice(1, -1), 2.0 * TICK_S
    # a table of 720 chords: chord and tangent differ by up to 1 % of the speed
    assert (rows[2:, X : Y + 1] - rows[:-2, X : Y + 1]) / h == pytest.approx(rows[inner, VX : VY + 1], abs=3e-3)
    assert (rows[2:, VX : VY + 1] - rows[:-2, VX : VY + 1]) / h == pytest.approx(rows[inner, AX : AY + 1], abs=5e-3)
    turn = np.unwrap(rows[:, PHI])
    assert (turn[2:] - turn[:-2]) / h == pytest.approx(rows[inner, WZ], abs=1e-2)


def test_acceleration_on_a_circle_is_v_squared_over_r_towards_its_middle():
    row = at(moving(kind="circle", centre_m=[0.2, -0.1]), 3.0)
    place = row[X : Y + 1] - [0.2, -0.1]
    assert np.linalg.norm(place) == pytest.approx(0.6, abs=1e-5)
    assert row[AX : AY + 1] == pytest.approx(-0.25**2 / 0.6**2 * place, abs=1e-5)
    assert np.linalg.norm(row[AX : AY + 1]) == pytest.approx(0.10417, abs=1e-5)


def test_a_circle_starts_on_the_x_axis_and_turns_left():
    row = at(moving(kind="circle", heading="tangent"), 0.0)
    assert row[X : VY + 1] == pytest.approx([0.6, 0.0, np.pi / 2.0, 0.0, 0.25], abs=1e-8)
    assert row[WZ] == pytest.approx(0.25 / 0.6, rel=1e-6)


def test_a_square_turns_left_at_its_corners_without_rounding_them():
    trajectory = moving(heading="tangent")
    before, after = at(trajectory, 4.8 - 0.005), at(trajectory, 4.8 + 0.005)  # 1.2 m / 0.25 m/s = 4.8 s
    assert before[X : VY + 1] == pytest.approx([0.6 - 0.00125, -0.6, 0.0, 0.25, 0.0], abs=1e-8)
    assert after[X : VY + 1] == pytest.approx([0.6, -0.6 + 0.00125, np.pi / 2.0, 0.0, 0.25], abs=1e-8)
    assert not before[WZ:].any()
    assert not after[WZ:].any()


def test_a_fixed_heading_stays():
    rows = way_points(moving(kind="circle", heading_rad=0.3), np.arange(0, 3000, 19))
    assert set(rows[:, PHI]) == {0.3}
    assert not rows[:, WZ].any()


def test_it_rests_at_the_start_until_its_time():
    row = at(Trajectory(start_s=2.0), 1.995)
    assert row[X : Y + 1] == pytest.approx([-0.6, -0.6])
    assert not row[VX:].any()
    assert at(Trajectory(start_s=2.0), 2.0)[VX] == pytest.approx(0.25)


def test_it_rests_at_the_end_of_an_open_path():
    row = at(moving(**POLYLINE, heading="tangent"), 3.1)
    assert row[X : PHI + 1] == pytest.approx([0.5, -0.25, -np.pi / 2.0])
    assert not row[VX:].any()


@pytest.mark.parametrize("laps", [1, 2, 3])
def test_a_closed_path_ends_after_its_laps_with_the_heading_of_its_last_edge(laps):
    trajectory = moving(laps=laps, heading="tangent")
    under_way, end = at(trajectory, 19.2 * laps - 0.1), at(trajectory, 19.2 * laps + 0.1)
    assert under_way[X : VY + 1] == pytest.approx([-0.6, -0.575, -np.pi / 2.0, 0.0, -0.25], abs=1e-7)
    assert end[X : PHI + 1] == pytest.approx([-0.6, -0.6, -np.pi / 2.0], abs=1e-7)
    assert not end[VX:].any()


def test_laps_are_alike():
    one, five = at(moving(laps=0), 3.0), at(moving(laps=0), 3.0 + 4 * 19.2)
    assert five[1:] == pytest.approx(one[1:], abs=1e-6)
    assert at(moving(laps=0), 40000.0)[VX : VY + 1].any()


def test_a_step_waits_at_its_first_place():
    step = Trajectory(kind="step", goal_m=[1.0, -0.5], heading_rad=0.2)
    assert list(at(step, 0.995, first=(0.1, 0.3))[1:]) == [0.1, 0.3, 0.2, 0, 0, 0, 0, 0, 0]
    assert list(at(step, 1.0, first=(0.1, 0.3))[1:]) == [1.0, -0.5, 0.2, 0, 0, 0, 0, 0, 0]


def test_a_pulse_goes_and_comes_back():
    pulse = Trajectory(kind="pulse", goal_m=[1.0, 0.0], width_s=2.0)
    away = way_points(pulse, np.arange(1000))[:, X] == 1.0
    assert list(np.flatnonzero(away)) == list(range(200, 600))  # 1 s to 3 s


@pytest.mark.parametrize("start_s, tick", [(0.0, 0), (0.095, 19), (0.95, 190), (0.96, 209)])
def test_a_step_on_a_tick_of_the_room_is_not_a_period_late(start_s, tick):
    step = Trajectory(kind="step", start_s=start_s)
    assert np.flatnonzero(way_points(step, np.arange(0, 400, 19))[:, X] == 1.0)[0] * 19 == tick


def test_it_is_renewed_every_19_ticks_before_controllers_compute():
    trajectory = moving(kind="line", goal_m=[1.0, 0.0])
    block = WayPoint(trajectory, build_path(trajectory, ""))
    simulator = Simulator(block)
    rows = []
    for tick in range(60):
        simulator.AdvanceTo((tick + 0.5) * TICK_S)
        rows.append(block.get_output_port().Eval(simulator.get_context()).copy())
    stamps = np.array(rows)[:, 0]
    assert list(stamps) == [19 * (tick // 19) for tick in range(60)]
    assert np.array(rows)[:, X] == pytest.approx(0.25 * TICK_S * stamps, abs=1e-12)


def test_before_the_first_tick_there_is_none():
    block = WayPoint(Trajectory(), build_path(Trajectory(), ""))
    assert list(block.get_output_port().Eval(block.CreateDefaultContext())) == [-1, 0, 0, 0, 0, 0, 0, 0, 0, 0]
