"""The hand-written C beside this file, built with the machine's C compiler."""

import ctypes
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np

OPTIONS = {"cc -O2": ["-O2"], "cc -O3 -march=native": ["-O3", "-march=native"]}
_FLOATS = ctypes.POINTER(ctypes.c_double)


class HandWritten:
    """A C file of this folder as a function; `x`, `d`, `p` as in a compiled Rollout.

    Args:
        name: of the file, without .c; options: of the compiler; folder: for the library.

    Raises:
        FileNotFoundError: this machine has no C compiler.
    """

    def __init__(self, name: str, options: list[str], folder: Path):
        compiler = shutil.which("cc") or shutil.which("gcc")
        if compiler is None:
            raise FileNotFoundError("this machine has no C compiler (cc)")
        library = folder / f"{name}{''.join(options)}.so"
        source = Path(__file__).with_name(f"{name}.c")
        fixed = ["-std=gnu11", "-ffp-contract=off", "-fno-math-errno", "-shared", "-fPIC"]
        subprocess.run([compiler, *fixed, *options, str(source), "-o", str(library), "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))
        self._library.rollout.restype = None
        self.sizes = [self._library.sizes(i) for i in range(3)]

    def run(self, ticks, x, d, p) -> tuple[float, np.ndarray]:
        """Time of this core [s] and the final state, continuous then discrete."""
        x, d, p = (np.array(v, dtype=float) for v in (x, d, p))
        if [len(x), len(d), len(p)] != self.sizes:
            raise ValueError(f"the C file is for sizes {self.sizes}, the Diagram has {[len(x), len(d), len(p)]}")
        pointers = [v.ctypes.data_as(_FLOATS) for v in (x, d, p)]
        started = time.thread_time()
        self._library.rollout(ctypes.c_int64(ticks), *pointers)
        return time.thread_time() - started, np.concatenate([x, d])
