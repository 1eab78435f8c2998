"""The drive EMPS as a recording."""

import numpy as np
import pytest
from scipy.io import savemat

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.importers.emps import Drive, load_drive, load_run
from drake_ispace.robots.recordings import load

DATA = {
    "t": [[0.0], [0.001], [0.002]], "qm": [[0.0], [0.1], [0.2]], "qg": [[0.0], [0.2], [0.4]],
    "vir": [[1.0], [2.0], [-3.0]], "gtau": 35.0, "kp": 160.0, "kv": 243.0,
}  # fmt: skip


@pytest.fixture
def file(tmp_path):
    savemat(tmp_path / "a.mat", DATA)
    return tmp_path / "a.mat"


def test_channels_in_newtons_and_metres(file):
    run = load_run(file)
    torque, encoder, reference = (run.channels[name] for name in ("torque", "encoder", "reference"))
    np.testing.assert_array_equal(torque.column("tau_1"), [35.0, 70.0, -105.0])
    np.testing.assert_array_equal(encoder.column("theta_1"), [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(reference.values, [[0, 0, 0], [0.2, 0, 0], [0.4, 0, 0]])
    assert (torque.units, encoder.units, torque.period_s) == ({"tau_1": "N"}, {"theta_1": "m"}, 0.001)
    assert load_drive(file) == Drive(35.0, 160.0, 243.0)


def test_only_as_a_wheel_it_can_be_saved(file):
    with pytest.raises(InputError, match=r"units\.tau_1 is 'N'"):
        load_run(file).save(file.with_name("saved"))
    run = load_run(file, radius_m=0.5)
    run.save(file.with_name("saved"))
    again = load(file.with_name("saved"))
    np.testing.assert_array_equal(again.channels["torque"].column("tau_1"), [17.5, 35.0, -52.5])
    np.testing.assert_array_equal(again.channels["encoder"].column("theta_1"), [0.0, 0.2, 0.4])


def test_a_wheel_has_a_radius(file):
    with pytest.raises(ValueError, match=r"radius_m is 0\.0"):
        load_run(file, radius_m=0.0)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"vir": None}, "variable 'vir' is missing, expected t, qm, qg, vir, gtau, kp and kv"),
        ({"qm": [[0.0], [0.1]]}, "variable 'qm' is float64 (2, 1), expected 3 real numbers"),
        ({"qm": "abc"}, "variable 'qm' is <U3 (1,), expected 3 real numbers"),
        ({"t": np.eye(2)}, "variable 't' is float64 (2, 2), expected a row or column of real numbers"),
        ({"qg": [[0.0], [np.nan], [0.4]]}, "variable 'qg' holds no or not only finite numbers, expected finite ones"),
        ({"t": [[0.0], [0.0], [0.1]]},
         "channel 'reference': sample 2: t = 0.0 s follows t = 0.0 s, expected t to increase"),
    ],
)  # fmt: skip
def test_bad_variables_are_refused(file, change, sentence):
    savemat(file, {name: value for name, value in (DATA | change).items() if value is not None})
    with pytest.raises(InputError) as error:
        load_run(file)
    assert str(error.value) == f"{file}: {sentence}"


@pytest.mark.parametrize("content", [b"", b"no MATLAB file", b"MATLAB 5.0" + 300 * b"\xff"])
def test_other_files_are_refused(tmp_path, content):
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(InputError, match=r"a.mat: expected a MATLAB file"):
        load_run(tmp_path / "a.mat")


def test_no_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected a MATLAB file, there is none"):
        load_run(tmp_path)


def test_measured_run_obeys_its_controller(measured):
    file = measured("emps/DATA_EMPS.mat")
    run, drive = load_run(file), load_drive(file)
    position = run.channels["encoder"].column("theta_1")
    error = run.channels["reference"].column("x") - position
    speed = np.concatenate([[0.0, 0.0], (position[2:] - position[:-2]) / (2 * run.channels["torque"].period_s)])
    force = drive.gain_n_v * drive.kv_v_s_m * (drive.kp_per_s * error - speed)
    measured_force = run.channels["torque"].column("tau_1")
    assert np.linalg.norm((force - measured_force)[5:]) < 0.005 * np.linalg.norm(measured_force)
