"""Jobs that can run side by side, in as many threads as there are cores."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar

from threadpoolctl import threadpool_limits

_pool: ContextVar[ThreadPoolExecutor | None] = ContextVar("pool", default=None)
_in_job: ContextVar[bool] = ContextVar("in_job", default=False)


@contextmanager
def side_by_side() -> Iterator[None]:
    """Within it `each` has threads. BLAS has only one: with threads of its own besides it would be slower."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ExitStack() as stack:
        stack.enter_context(threadpool_limits(1, "blas"))
        if cores > 1:
            pool = ThreadPoolExecutor(cores)
            stack.callback(pool.shutdown, cancel_futures=True)
            stack.callback(_pool.reset, _pool.set(pool))
        yield


def each(function: Callable, *iterables: Iterable) -> list:
    """A list of what `map` gives, computed side by side within `side_by_side`.

    Jobs may have jobs of their own. The thread of a job computes those that no other thread has begun, and waits for
    the rest only: never for a job that waits for a thread.
    """
    pool, jobs = _pool.get(), list(zip(*iterables, strict=True))
    if pool is None or len(jobs) < 2:
        return [function(*job) for job in jobs]
    calls, own = [[function, job] for job in jobs], []
    futures = [pool.submit(_in_thread, pool, call) for call in calls]
    while _in_job.get() and len(own) < len(jobs) and futures[-1 - len(own)].cancel():  # threads begin with the first
        calls[-1 - len(own)].clear()  # a cancelled job stays in the pool's queue, and would keep its data there
        own.append(function(*jobs[-1 - len(own)]))
    return [future.result() for future in futures[: len(jobs) - len(own)]] + own[::-1]


def _in_thread(pool, call):
    """What the function of the call gives for its job, in a thread of the pool."""
    _pool.set(pool)
    _in_job.set(True)
    function, job = call
    return function(*job)
