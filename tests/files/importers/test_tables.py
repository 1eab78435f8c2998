"""Tables of numbers without a header."""

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.importers.tables import parse_numbers, period_of, read_lines


def test_numbers_between_blanks_comments_and_empty_lines(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"% head\r\n1 2 \r\n\r\n-0  3e1\r\n")
    np.testing.assert_array_equal(parse_numbers(read_lines(path), path), [[1, 2], [0, 30]])


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"1,2\n3\n", "line 2: 1 cells, expected 2"),
        (b"1,2\n3,nan\n", "line 2: column 2 holds 'nan', expected a finite number"),
        (b"1,2\n3,\n", "line 2: column 2 holds '', expected a finite number"),
        (b"1,1_0\n", "line 1: column 2 holds '1_0', expected a finite number"),
        (b"% only a head\n", "no row of numbers, expected at least one"),
        (b"1,\xff\n", "holds byte 0xff, expected UTF-8 text"),
    ],
)
def test_bad_tables_are_refused(tmp_path, content, sentence):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        parse_numbers(read_lines(path), path, ",")
    assert str(error.value) == f"{path}: {sentence}"


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(InputError, match="expected a file, there is none"):
        read_lines(tmp_path)


def test_period():
    assert period_of(np.array([0.0, 0.03, 0.0600000001, 0.091])) == 0.03
    assert period_of(np.array([1.0])) is None
