"""Paths as tables over arc length: hand-checkable distances, order along the path, tables of points from files."""

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.control.guide.paths import Trajectory, build_path


def path(**keywords):
    return build_path(Trajectory(**keywords), "omni.trajectory")


def test_a_circle_and_its_table_are_nowhere_further_apart_than_10_um():
    angle = np.linspace(0.0, 2.0 * np.pi, 10_007)
    gaps, _ = path(kind="circle", radius_m=0.6).nearest(0.6 * np.column_stack([np.cos(angle), np.sin(angle)]))
    assert gaps.max() < 1e-5


@pytest.mark.parametrize("radius_m", [0.1, 0.6, 2.0])
def test_curvature_of_a_circle_is_one_over_its_radius(radius_m):
    table = path(kind="circle", radius_m=radius_m, centre_m=[0.3, -0.2]).table
    assert table[:, 5] == pytest.approx(np.full(len(table), 1.0 / radius_m), rel=1e-5)


def test_a_figure_eight_is_straight_at_its_crossing_and_mirrored():
    table = path(kind="figure_eight", radius_m=0.5).table
    quarter = (len(table) - 1) // 4
    assert table[[0, 2 * quarter, 4 * quarter], 5] == pytest.approx(np.zeros(3), abs=1e-5)
    assert table[: 2 * quarter, 5] == pytest.approx(-table[2 * quarter : -1, 5], abs=1e-4)


def test_a_corner_is_two_rows_of_the_same_place():
    table = path(kind="square", side_m=1.0).table
    assert table[:, 0] == pytest.approx([0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0])
    assert table[1, 1:3].tolist() == table[2, 1:3].tolist() == [0.5, -0.5]
    assert table[1, 3:5].tolist() == [1.0, 0.0] and table[2, 3:5].tolist() == [0.0, 1.0]


def test_beyond_the_end_of_a_line_the_end_is_nearest():
    gaps, arcs = path(kind="line", goal_m=[1.0, 0.0]).nearest(np.array([[1.3, 0.4], [-0.3, 0.4], [0.25, 0.0]]))
    assert gaps == pytest.approx([0.5, 0.5, 0.0]) and arcs == pytest.approx([1.0, 0.0, 0.25])


def test_progress_does_not_jump_to_the_other_side_of_a_narrow_way_back():
    there_and_back = path(kind="polyline", points_m=[[0, 0], [1, 0], [1, 0.01], [0, 0.01]])
    assert there_and_back.progress(np.array([0.3, 0.009]), 0.25) == pytest.approx(0.05)


@pytest.mark.parametrize("kind", ["circle", "square", "figure_eight"])
def test_places_met_lap_after_lap_add_up(kind):
    built = path(kind=kind)
    arcs = np.linspace(0.0, 5.0 * built.length_m, 1001)
    x, y = (np.interp(arcs % built.length_m, built.table[:, 0], built.table[:, i]) for i in (1, 2))
    reached = 0.0
    for point in np.column_stack([x, y]):
        reached += built.progress(point, reached)
    assert reached == pytest.approx(5.0 * built.length_m, abs=1e-6)


def test_going_backwards_is_negative_progress():
    behind = np.array([np.cos(0.2), -np.sin(0.2)])
    assert path(kind="circle", radius_m=1.0).progress(behind, 0.0) == pytest.approx(-0.2, abs=1e-4)


# ------------------------------------------------------------------------------------------------------- from files

READABLE = {
    "plain": "x,y\n0,0\n1,0.5\n",
    "blanks": " x , y \n 0 , 0 \n1,\t.5\n",
    "blank_lines": "x,y\n\n0,0\n\n1,5e-1\n\n",
    "crlf": "x,y\r\n0,0\r\n1,0.5\r\n",
    "utf8_mark": "\ufeffx,y\n0,0\n1,0.5\n",
    "no_line_end": "x,y\n0,0\n1,0.5",
}


@pytest.mark.parametrize("text", READABLE.values(), ids=READABLE.keys())
def test_points_are_read_from_a_file(tmp_path, text):
    (tmp_path / "path.csv").write_bytes(text.encode())
    built = path(kind="polyline", csv=str(tmp_path / "path.csv"))
    assert built.points_m.tolist() == [[0.0, 0.0], [1.0, 0.5]] and not built.closed


def test_a_file_is_looked_for_from_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "path.csv").write_text("x,y\n0,0\n1,0\n0,1\n0,0\n")
    monkeypatch.chdir(tmp_path)
    built = path(kind="polyline", csv="path.csv")
    assert built.closed and built.length_m == pytest.approx(2.0 + np.sqrt(2.0))


def test_points_and_a_file_at_once_are_refused(tmp_path):
    (tmp_path / "path.csv").write_text(READABLE["plain"])
    with pytest.raises(InputError, match=r"^omni.trajectory.csv: expected kind polyline and no points_m"):
        path(kind="polyline", points_m=[[0, 0], [1, 1]], csv=str(tmp_path / "path.csv"))


def test_ten_thousand_points_are_measured(tmp_path):
    points = np.column_stack([np.linspace(-1.0, 1.0, 10_000), np.zeros(10_000)])
    np.savetxt(tmp_path / "path.csv", points, delimiter=",", header="x,y", comments="")
    gaps, _ = path(kind="polyline", csv=str(tmp_path / "path.csv")).nearest(np.tile([[0.3, 0.2]], (1000, 1)))
    assert gaps == pytest.approx(np.full(1000, 0.2))
