"""How logged outputs change with parameters: finite differences over compiled rollouts."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from drake_ispace.rollout.compile import Rollout


def jacobian(
    rollout: Rollout, ticks: int, names: Sequence[str], parameters: np.ndarray | None = None,
    relative_step: float = 1e-4, least_step: float = 1e-6, threads: int = 2,
) -> dict[str, np.ndarray]:
    """Central differences of every logged output with respect to named parameters.

    Args:
        rollout: whose logs are differentiated; ticks: length of the run.
        names: of parameters, as `rollout.parameter_names`; parameters: where to differentiate, default the Context's.
        relative_step, least_step: step = max(relative_step |value|, least_step).
        threads: rollouts at once; the compiled function holds no lock.

    Returns:
        name of a log -> (rows, size, len(names)), unit of the output per unit of the parameter.

    Raises:
        InputError: no parameter of that name.

    Encoder counts and camera pixels make an output a staircase: there choose a step that spans many counts.
    """
    centre = np.array(rollout.parameters if parameters is None else parameters, dtype=float)
    indices = [rollout.index(name) for name in names]
    steps = [max(relative_step * abs(centre[i]), least_step) for i in indices]

    def shifted(job):
        index, step = job
        moved = centre.copy()
        moved[index] += step
        return rollout.run(ticks, moved)

    jobs = [(i, sign * step) for i, step in zip(indices, steps, strict=True) for sign in (1.0, -1.0)]
    with ThreadPoolExecutor(threads) as pool:
        runs = list(pool.map(shifted, jobs))
    pairs = zip(runs[0::2], runs[1::2], steps, strict=True)
    columns = [{name: (up[name] - down[name]) / (2.0 * step) for name in up} for up, down, step in pairs]
    return {name: np.stack([column[name] for column in columns], axis=-1) for name in rollout.logged}
