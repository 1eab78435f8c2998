"""A process that reads a table ends cleanly: none of Arrow's pools of threads is begun, which can abort at its end."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drake_ispace.files.recording_tables import write_table

COUNTS = """
import os, sys
from pathlib import Path
import pyarrow.csv, pyarrow.parquet
from drake_ispace.files.recording_tables import read_table
print(pyarrow.cpu_count() + pyarrow.io_thread_count())
before = len(os.listdir("/proc/self/task"))
read_table(Path(sys.argv[1]))
print(len(os.listdir("/proc/self/task")) - before)
"""


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted in /proc")
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_no_pool_of_threads_is_begun(tmp_path, ending):
    path = tmp_path / f"table.{ending}"
    write_table(path, ("t", "x", "y"), np.arange(3000.0).reshape(-1, 3))
    done = subprocess.run([sys.executable, "-c", COUNTS, path], capture_output=True, text=True)
    pools, begun = map(int, done.stdout.split())
    assert pools > 1 >= begun  # the one is what receives signals, for as long as a table is read
