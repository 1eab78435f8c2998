"""Jobs side by side give what one after the other gives."""

import threading
import weakref
from concurrent.futures import Future

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain import threads
from drake_ispace.explain.decide.decide import decide
from drake_ispace.explain.threads import each, side_by_side
from stand_ins.linear import Linear, made, no_generics, noise, pattern

CORES = 2


@pytest.fixture(autouse=True)
def two_cores(monkeypatch):
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda pid: range(CORES), raising=False)


def test_results_are_in_the_order_of_the_jobs():
    with side_by_side():
        assert each(lambda a, b: 2 * a - b, range(50), range(50)) == list(range(50))


def test_without_threads_the_caller_computes():
    assert each(lambda _: threading.current_thread(), range(3)) == [threading.current_thread()] * 3


def test_two_jobs_run_at_the_same_time():
    meeting = threading.Barrier(2, timeout=10.0)  # broken if one is over before the other begins
    with side_by_side():
        assert sorted(each(lambda _: meeting.wait(), range(2))) == [0, 1]


def test_jobs_of_jobs_of_jobs_end():
    def count(depth):
        return 1 if depth == 0 else sum(each(count, [depth - 1] * 3))

    with side_by_side():
        assert count(5) == 3**5


def test_whoever_is_free_computes_jobs_of_a_job():
    meeting = threading.Barrier(2, timeout=10.0)
    with side_by_side():
        alone, both = each(lambda alone: alone or each(lambda _: meeting.wait(), range(2)), [True, False])
    assert alone and sorted(both) == [0, 1]


def test_what_a_job_of_a_job_used_is_let_go_at_once():
    done = threading.Barrier(CORES, timeout=10.0)  # until then no thread looks at what waits in the pool

    def outer(_):
        data = np.ones(3)
        gone = weakref.ref(data)
        each(np.sum, [data] * 8)
        del data
        is_gone = gone() is None
        done.wait()
        return is_gone

    with side_by_side():
        assert all(each(outer, range(CORES)))


def test_an_error_of_a_job_is_the_callers():
    def divide(x):
        return 1 / x

    with side_by_side(), pytest.raises(ZeroDivisionError):
        each(divide, [1, 0, 2])


def test_after_an_error_no_further_job_begins():
    begun, release = [], Future()

    def job(number):
        begun.append(number)
        if number == 0:
            raise ValueError
        release.result(timeout=10.0)

    with pytest.raises(ValueError), side_by_side():
        try:
            each(job, range(20))
        finally:
            threading.Timer(0.1, release.set_result, [None]).start()
    assert len(begun) <= CORES + 1


def test_a_decision_does_not_depend_on_the_number_of_threads(monkeypatch):
    shapes = {"tilt": pattern(3), "drag": pattern(5), "lag": pattern(8)}
    runs = Linear(noise() + 0.8 * shapes["tilt"] + 0.5 * shapes["lag"], shapes)
    decisions = []
    for cores in (1, 2):
        monkeypatch.setattr(threads.os, "sched_getaffinity", lambda pid, cores=cores: range(cores), raising=False)
        with side_by_side():
            found = decide(runs, made(*shapes), 0, generics=no_generics)
        sizes = {candidate.name: size[0] for candidate, size in found.named.point.items()}
        decisions.append((found.detection, sizes, {candidate.name: gain for candidate, gain in found.gains.items()}))
    assert decisions[0] == decisions[1] and set(decisions[0][1]) == {"tilt", "lag"}


@pytest.mark.slow
def test_an_answer_does_not_depend_on_the_number_of_threads(monkeypatch):
    scenario, known = di.load_scenario("omni_multirate"), di.effects()
    effects = [known["floor_tilt"], known["coulomb_friction"]]
    runs = di.hide(scenario, "omni", {"coulomb_friction": {"torque_n_m": 0.02}}, ["square", "figure_eight"], 0, 5.0)
    answers = []
    for cores in (1, 2):
        monkeypatch.setattr(threads.os, "sched_getaffinity", lambda pid, cores=cores: range(cores), raising=False)
        found = di.explain(scenario, runs, effects=effects)
        answers.append(repr(found.to_data() | {"seconds": 0.0}))
    assert answers[0] == answers[1] and found.effects
