"""Runs of OptiOdom as recordings; on the measured ones odometry meets the ceiling system."""

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.importers.optiodom import Metadata, load_folder, load_run, read_metadata
from drake_ispace.plants.wheels import WheelGeometry, differential, omni3
from drake_ispace.robots.recordings import load

OMNI3 = "type,omni3,,\nngear,12,,\nencRes,1024,,\nLi,0.195,,\nDi,0.102,0.104,0.1\nThi,,,\nN,1,,\n"
DIFF = "type,diff,\nngear,43.7,\nencRes,64,\nLi,0.2,\nDi,0.084,0.084\n"
RUN = "0,0,0,0,-1,-0,7\n0.04,0.1,0,3.1,10,20,0\n0.08,0.2,0,-3.1,-4,1,2\n"

_WHEEL_1_RAD = -np.pi / 3.0


def geometry(metadata: Metadata) -> WheelGeometry:
    """The robot as its makers measured it, with its mean wheel radius; its wheels are in the order of `load_run`."""
    radius_m = float(np.mean(metadata.diameters_m)) / 2.0
    if metadata.kind == "omni3":
        return omni3(radius_m, metadata.wheel_distance_m, _WHEEL_1_RAD)
    return differential(radius_m, metadata.wheel_distance_m / 2.0)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "metadata.csv").write_text(OMNI3)
    (tmp_path / "run-01.csv").write_text(RUN)
    return tmp_path


def test_omni3_in_si_units(folder):
    run = load_run(folder / "run-01.csv")
    count = 2 * np.pi / (12 * 1024)
    encoder, kinect = run.channels["encoder"], run.channels["kinect"]
    assert (run.robot, encoder.columns) == ("omni3", ("theta_1", "theta_2", "theta_3"))
    assert kinect.columns == ("x", "y", "phi")
    np.testing.assert_allclose(encoder.values, -count * np.array([[0, 0, 0], [10, 20, 0], [6, 21, 2]]), atol=1e-15)
    np.testing.assert_allclose(kinect.column("phi"), [0, 3.1, 2 * np.pi - 3.1])  # continuous
    assert encoder.period_s == kinect.period_s == 0.04


def test_diff_has_right_before_left(tmp_path):
    (tmp_path / "metadata.csv").write_text(DIFF)
    (tmp_path / "run-01.csv").write_text("0,0,0,0,0,0\n0.05,0,0,0,2,-1\n")
    run = load_folder(tmp_path)[0]
    count = 2 * np.pi / (43.7 * 64)
    assert (run.robot, run.channels["encoder"].columns) == ("differential", ("theta_r", "theta_l"))
    np.testing.assert_allclose(run.channels["encoder"].values[-1], [2 * count, -count])


def test_metadata_and_its_geometry(folder):
    metadata = read_metadata(folder / "metadata.csv")
    assert metadata == Metadata("omni3", 12.0, 1024.0, 0.195, (0.102, 0.104, 0.1))
    turning = geometry(metadata).forward @ [1.0, 1.0, 1.0]
    np.testing.assert_allclose(turning, [0.0, 0.0, 0.051 / 0.195], atol=1e-15)
    forwards = geometry(metadata).inverse @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(forwards * 0.051, [np.sqrt(0.75), -np.sqrt(0.75), 0.0], atol=1e-15)


def test_metadata_may_lie_elsewhere(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("other") / "robot.csv"
    (folder / "metadata.csv").rename(other)
    assert load_run(folder / "run-01.csv", other).robot == "omni3"


def test_a_run_can_be_saved(folder):
    run = load_run(folder / "run-01.csv")
    run.save(folder / "saved")
    np.testing.assert_array_equal(load(folder / "saved").channels["encoder"].values, run.channels["encoder"].values)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("omni3", "omni5", "type is 'omni5', did you mean 'omni3'?"),
        ("type,omni3,,", "", "type is '', expected one of omni3, diff"),
        ("ngear,12,,", "", "ngear is missing, expected 1 positive number"),
        ("ngear,12", "ngear,-12", "ngear is '-12', expected 1 positive number"),
        ("encRes,1024", "encRes,many", "encRes is 'many', expected 1 positive number"),
        ("0.104,0.1", "0.104", "Di is '0.102,0.104', expected 3 positive numbers"),
    ],
)
def test_bad_metadata_is_refused(folder, old, new, sentence):
    file = folder / "metadata.csv"
    file.write_text(OMNI3.replace(old, new))
    with pytest.raises(InputError) as error:
        load_run(folder / "run-01.csv")
    assert str(error.value) == f"{file}: {sentence}"


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (RUN.replace(",7", ""), "line 1: 6 cells, expected 7"),
        (RUN.replace("0.1", "x"), "line 2: column 2 holds 'x', expected a finite number"),
        (RUN.replace("0.08", "0.01"),
         "channel 'encoder': sample 3: t = 0.01 s follows t = 0.04 s, expected t to increase"),
        ("", "no row of numbers, expected at least one"),
    ],
)  # fmt: skip
def test_bad_runs_are_refused(folder, content, sentence):
    file = folder / "run-01.csv"
    file.write_text(content)
    with pytest.raises(InputError) as error:
        load_run(file)
    assert str(error.value) == f"{file}: {sentence}"


def test_missing_files_are_refused(folder):
    with pytest.raises(InputError, match=r"run-02.csv: expected a file, there is none"):
        load_run(folder / "run-02.csv")
    (folder / "run-01.csv").unlink()
    with pytest.raises(InputError, match=r"expected a folder with files run-\*.csv, there is none"):
        load_folder(folder)


@pytest.mark.parametrize(
    ("name", "runs", "path_share"),
    [
        ("omni3/circular", 12, 0.03), ("omni3/square", 12, 0.03), ("omni3/joystick", 8, 0.02),
        ("diff/circular", 10, 0.012), ("diff/square", 10, 0.01), ("diff/free", 2, 0.008),
    ],
)  # fmt: skip
def test_nominal_odometry_follows_the_ceiling_system(measured, name, runs, path_share):
    folder = measured(f"optiodom/{name}")
    recordings = load_folder(folder)
    assert len(recordings) == runs
    forward = geometry(read_metadata(folder / "metadata.csv")).forward
    for run in recordings:
        seen = run.channels["kinect"].values
        steps = np.diff(run.channels["encoder"].values, axis=0) @ forward.T
        phi = seen[0, 2] + np.concatenate([[0.0], np.cumsum(steps[:, 2])])
        middle = phi[:-1] + steps[:, 2] / 2
        moves = np.exp(1j * middle) * (steps[:, 0] + 1j * steps[:, 1])
        place = seen[:, 0] + 1j * seen[:, 1]
        error = place[0] + np.concatenate([[0.0], np.cumsum(moves)]) - place
        path = abs(np.diff(place)).sum()
        assert np.sqrt(np.mean(abs(error) ** 2)) < path_share * path
        assert abs(phi[-1] - seen[-1, 2]) < 0.035 * np.abs(np.diff(phi)).sum() + 0.02
