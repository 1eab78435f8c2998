"""Tables of any shape: what separates cells, decimal commas, headers, missing cells."""

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.logs.series import read_series, shape_of

TABLE = "t,a b,c\n0.0,1.5,-2\n0.1,2.5,3e2\n0.2,-3.25,4\n"
VALUES = {"t": [0.0, 0.1, 0.2], "a b": [1.5, 2.5, -3.25], "c": [-2.0, 300.0, 4.0]}


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def assert_is_table(series, names=tuple(VALUES)):
    assert list(series.columns) == list(names)
    for name, wanted in zip(names, VALUES.values(), strict=True):
        assert list(series.columns[name]) == wanted


@pytest.mark.parametrize("mark", [",", ";", "\t", "|"])
def test_what_separates_the_cells_is_seen(tmp_path, mark):
    assert_is_table(read_series(written(tmp_path / "a.csv", TABLE.replace(",", mark))))


@pytest.mark.parametrize("mark", [";", "\t"])
def test_decimal_commas_are_seen(tmp_path, mark):
    text = TABLE.replace(",", mark).replace(".", ",")
    assert shape_of(written(tmp_path / "a.csv", text)).decimal == ","
    assert_is_table(read_series(tmp_path / "a.csv"))


def test_white_space_comments_and_no_header(tmp_path):
    text = "# by a logger\n% of 1999\n0.0   1.5 -2\n0.1 2.5    3e2\n\n0.2 -3.25 4\n"
    assert_is_table(read_series(written(tmp_path / "a.txt", text)), ("1", "2", "3"))


def test_a_byte_order_mark_windows_lines_and_quotes(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbf" + TABLE.replace("a b", '"a b"').replace("\n", "\r\n").encode())
    assert_is_table(read_series(tmp_path / "a.csv"))


def test_only_the_columns_that_are_wanted_need_be_numbers(tmp_path):
    text = TABLE.replace("1.5", "on").replace("2.5", "off")
    series = read_series(written(tmp_path / "a.csv", text), ["c", "t"])
    assert list(series.columns) == ["c", "t"] and list(series.columns["c"]) == VALUES["c"]


@pytest.mark.parametrize("cell", ["", "nan", "NaN"])
def test_a_missing_cell_is_no_number(tmp_path, cell):
    found = read_series(written(tmp_path / "a.csv", TABLE.replace("2.5", cell))).columns["a b"]
    assert np.isnan(found[1]) and found[0] == 1.5


def test_a_first_row_with_a_missing_cell_is_no_header(tmp_path):
    found = read_series(written(tmp_path / "a.txt", "0.0,nan,1\n0.1,2.0,3\n")).columns
    assert list(found) == ["1", "2", "3"] and np.isnan(found["2"][0])


def test_parquet_with_integers_and_nulls(tmp_path):
    table = pyarrow.table({"t": [0, 1, 2], "x": pyarrow.array([1.5, None, 2.5])})
    pyarrow.parquet.write_table(table, tmp_path / "a.parquet")
    found = read_series(tmp_path / "a.parquet").columns
    assert list(found["t"]) == [0.0, 1.0, 2.0] and np.isnan(found["x"][1])


def test_a_tum_trajectory_has_the_names_of_its_columns(tmp_path):
    found = read_series(written(tmp_path / "a.tum", "0.5 1 2 0 0 0 0 1\n0.6 1 2 0 0 0 0 1\n")).columns
    assert list(found) == ["t", "x", "y", "z", "qx", "qy", "qz", "qw"] and list(found["t"]) == [0.5, 0.6]


@pytest.mark.parametrize("text, wanted, message", [
    (TABLE.replace("2.5", "2.5x"), None, "line 3: column 'a b' holds '2.5x', expected a number"),
    (TABLE.replace("2.5", "inf"), None, "line 3: column 'a b' holds 'inf'"),
    (TABLE.replace("2.5", "1_0"), None, "line 3"),
    (TABLE.replace(",3e2", ""), None, "line 3: 2 cells, expected 3"),
    (TABLE.replace("0.1,2.5,3e2", "hello"), ["t"], "line 3: 1 cells, expected 3"),
    (TABLE, ["d"], "there is no column 'd'"),
    (TABLE.replace("a b", "c"), None, "column 'c' is there twice"),
    ("", None, "holds no rows"),
    ("t,x\n", None, "no row of numbers"),
])
def test_what_is_wrong_is_named(tmp_path, text, wanted, message):
    with pytest.raises(InputError, match=r"a\.csv") as refusal:
        read_series(written(tmp_path / "a.csv", text), wanted)
    assert message in str(refusal.value)


@pytest.mark.parametrize("data", [b"\x00\x01", b"t,x\n\xff,1\n", b"PAR1"])
def test_what_is_no_text_is_refused(tmp_path, data):
    (tmp_path / "a.csv").write_bytes(data)
    with pytest.raises(InputError):
        read_series(tmp_path / "a.csv")
