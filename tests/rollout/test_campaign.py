"""Campaigns: what runs draw, what becomes of interrupted ones, and that threads and clusters change nothing."""

import math

import numpy as np
import pyarrow as pa
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.metrics import measure
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.rollout.many.campaign import CampaignStopped, make_plan, montecarlo
from drake_ispace.rollout.many.draws import find_parameter, noise_seed, parse_distribution, split_vary
from drake_ispace.rollout.many.table import Rows, read_campaign, spread
from drake_ispace.rollout.many.worker import METRICS
from drake_ispace.scenario import load_scenario, with_option

MASS, SLIP = "omni_plant.mass_kg", "omni_plant.slip.ratio_x"
VARY = {MASS: "normal(7.3, 0.3)", SLIP: "uniform(0, 0.2)"}


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("omni_multirate", ["seconds=2"])


@pytest.fixture(scope="module")
def whole(scenario):
    """The table of an uninterrupted campaign of two batches."""
    return montecarlo(scenario, 150, vary=VARY, threads=1).table


# -- draws ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "share", "value"), [
    ("normal(7, 0.5)", 0.5, 7.0),
    ("normal(0, 1)", 0.975, 1.959963984540054),
    ("uniform(2, 4)", 0.25, 2.5),
    ("loguniform(1, 100)", 0.5, 10.0),
    ("loguniform(2, 200)", 0.5, 20.0),
    ("choice(-3, -1)", 0.6, -1.0),
    ("choice(3, 5, 9)", 0.34, 5.0),
    ("choice(3)", 0.999999, 3.0),
])
def test_quantiles_by_hand(text, share, value):
    assert parse_distribution(text, "here").quantile(share) == pytest.approx(value, rel=1e-12)


def test_draws_have_the_distribution_they_name():
    draws = parse_distribution("normal(7, 0.5)", "here").draws(3, MASS, range(4000))
    assert np.mean(draws) == pytest.approx(7.0, abs=4 * 0.5 / math.sqrt(4000))
    assert np.std(draws) == pytest.approx(0.5, rel=0.05)


def test_a_draw_depends_on_seed_key_and_run_only():
    distribution = parse_distribution("uniform(0, 1)", "here")
    many = distribution.draws(0, MASS, range(10))
    assert distribution.draws(0, MASS, [7])[0] == many[7]
    assert distribution.draws(1, MASS, [7])[0] != many[7]
    assert distribution.draws(0, SLIP, [7])[0] != many[7]


def test_noise_seeds_differ_and_fit_into_a_float():
    seeds = [noise_seed(0, run) for run in range(2000)]
    assert len(set(seeds)) == 2000 and max(seeds) < 2**52


def test_a_distribution_reads_its_own_text():
    distribution = parse_distribution(" loguniform( 1e-3,0.1 )", "here")
    assert parse_distribution(str(distribution), "here") == distribution


@pytest.mark.parametrize(("text", "said"), [
    ("normal", "expected a distribution such as normal"),
    ("nomal(1, 2)", "did you mean 'normal'"),
    ("normal(1)", "expected two numbers"),
    ("normal(1, -2)", "standard deviation of at least 0"),
    ("uniform(2, 1)", "low <= high"),
    ("loguniform(0, 1)", "more than 0"),
    ("choice()", "expected numbers"),
    ("normal(nan, 1)", "expected numbers"),
    ("uniform(1_0, 20)", "expected numbers"),
    ("uniform(0, 1e999)", "expected numbers"),
])
def test_bad_distributions_are_refused_in_one_sentence(text, said):
    with pytest.raises(InputError, match=said) as refusal:
        parse_distribution(text, "--vary key")
    assert "\n" not in str(refusal.value) and str(refusal.value).startswith("--vary key")


@pytest.mark.parametrize("words", [["a"], ["=normal(1,2)"], ["a=choice(1)", "a=choice(2)"]])
def test_bad_words_of_vary_are_refused(words):
    with pytest.raises(InputError, match="--vary"):
        split_vary(words)


# -- parameters ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", [MASS, "omni.plant.mass_kg"])
def test_a_parameter_is_found_under_both_spellings(key):
    assert find_parameter(key, [MASS, SLIP], "--vary") == MASS


def test_a_misspelt_parameter_is_asked_about():
    with pytest.raises(InputError, match=r"did you mean 'omni_plant\.mass_kg'"):
        find_parameter("omni.plant.mas_kg", [MASS, SLIP], "--vary")


def test_the_key_of_a_random_stream_is_no_parameter():
    with pytest.raises(InputError, match="no parameter"):
        find_parameter("a.noise_stream[0]", ["a.noise_stream[0]", MASS], "--vary")


def test_a_draw_that_the_scenario_would_refuse_is_refused(scenario):
    with pytest.raises(InputError, match=r"omni\.plant\.mass_kg: expected more than 0"):
        make_plan(scenario, 100, {MASS: "normal(1, 5)"}, ({},), 0)


def test_one_parameter_under_two_spellings_is_refused(scenario):
    with pytest.raises(InputError, match="twice"):
        make_plan(scenario, 1, {MASS: "choice(7)", "omni.plant.mass_kg": "choice(7)"}, ({},), 0)


# -- rows ----------------------------------------------------------------------------------------------------------


def test_a_row_holds_the_metrics_of_its_run(scenario, whole):
    fixed = load_scenario("omni_multirate", ["seconds=2"])
    table = montecarlo(fixed, 3).table
    row = table.to_pylist()[2]
    metrics = measure(simulate_compiled(with_option(fixed, "seed", row["seed"])), "omni")
    assert [row[name] for name in METRICS] == pytest.approx([getattr(metrics, name) for name in METRICS], rel=1e-12)


def test_lanes_do_not_change_the_table(scenario, whole, monkeypatch):
    monkeypatch.setattr("drake_ispace.rollout.many.worker._LANES_PAY_TICKS", 0)
    assert montecarlo(scenario, 150, vary=VARY).table.equals(whole)


@pytest.mark.parametrize(("robot", "trajectory"), [
    ("omni", "{kind: step, goal_m: [0.4, 0.2]}"), ("pendulum", "{kind: circle, radius_m: 0.6, start_s: 0.5}"),
])
def test_metrics_added_up_tick_by_tick_are_those_of_the_logs(robot, trajectory):
    fixed = load_scenario(f"{robot}_multirate", ["seconds=2", f"{robot}.trajectory={trajectory}"])
    row = montecarlo(fixed, 1).table.to_pylist()[0]
    metrics = measure(simulate_compiled(with_option(fixed, "seed", row["seed"])), robot)
    assert [row[name] for name in METRICS] == pytest.approx([getattr(metrics, name) for name in METRICS], rel=1e-11)


def test_what_adds_the_metrics_up_cannot_be_varied(scenario):
    with pytest.raises(InputError, match="no parameter"):
        montecarlo(scenario, 1, vary={"omni_errors.start_tick": "choice(3)"})


def test_varied_values_stand_in_their_rows(scenario, whole):
    drawn = parse_distribution(VARY[MASS], "here").draws(0, MASS, range(150))
    assert np.array_equal(whole[MASS].to_numpy(), drawn)
    assert whole["run"].to_pylist() == list(range(150))


def test_threads_do_not_change_the_table(scenario, whole):
    assert montecarlo(scenario, 150, vary=VARY, threads=2).table.equals(whole)


def test_a_run_that_diverges_is_a_row_that_says_so(scenario):
    table = montecarlo(scenario, 2, vary={MASS: "choice(0.05)"}).table
    row = table.to_pylist()[0]
    assert row["diverged"] and 0.0 < row["diverged_at_s"] <= 2.0
    assert all(row[name] is None for name in METRICS)
    assert spread(table, METRICS)["iae_m_s"] == {"median": None, "p05": None, "p95": None, "max": None}


def test_scenarios_and_parameter_sets_share_their_draws(scenario):
    named = {"base": scenario, "heavy": load_scenario("omni_multirate", ["seconds=2", "omni.plant.mass_kg=9"])}
    sets, vary = [{}, {SLIP: 0.1}], {"omni_encoder.memory": "uniform(0.5, 0.9)"}
    table = montecarlo(named, 2, parameter_sets=sets, vary=vary).table
    assert table["scenario"].to_pylist() == ["base"] * 4 + ["heavy"] * 4
    assert table[SLIP].to_pylist() == [0.0, 0.0, 0.1, 0.1] * 2
    assert table["seed"].to_pylist() == [noise_seed(0, 0), noise_seed(0, 1)] * 4
    assert len(set(table["omni_encoder.memory"].to_pylist())) == 2
    assert len(set(table["rms_position_error_m"].to_pylist())) == 8


def test_robots_of_one_space_have_columns_of_their_own():
    campaign = montecarlo(load_scenario("shared_space", ["seconds=1"]), 1)
    assert {"omni.iae_m_s", "pendulum.iae_m_s"} <= set(campaign.metrics) <= set(campaign.table.column_names)


def test_a_path_from_a_file_travels_with_the_plan(scenario, tmp_path):
    (tmp_path / "path.csv").write_text("x,y\n0,0\n0.5,0.1\n0.5,0.5\n0.1,0.5\n0,0.2\n")
    sets = ["seconds=2", "omni.trajectory.kind=polyline"]
    corners = "[[0,0],[0.5,0.1],[0.5,0.5],[0.1,0.5],[0,0.2]]"
    points = load_scenario("omni_multirate", [*sets, f"omni.trajectory.points_m={corners}"])
    file = load_scenario("omni_multirate", [*sets, f"omni.trajectory.csv={tmp_path / 'path.csv'}"])
    assert make_plan(file, 1, {}, ({},), 0) == make_plan(points, 1, {}, ({},), 0)


# -- the folder ----------------------------------------------------------------------------------------------------


def test_the_folder_reads_back_as_the_same_table(scenario, whole, tmp_path):
    campaign = montecarlo(scenario, 150, vary=VARY, out=tmp_path)
    assert campaign.table.equals(whole) and read_campaign(tmp_path).equals(whole)


def test_a_finished_campaign_runs_nothing_again(scenario, tmp_path):
    montecarlo(scenario, 3, out=tmp_path)
    assert montecarlo(scenario, 3, out=tmp_path).runs_now == 0


def test_ctrl_c_keeps_what_is_done_and_the_same_call_resumes(scenario, whole, tmp_path):
    def interrupt(done, total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(CampaignStopped, match=r"after \d+ of 150 runs, they are kept"):
        montecarlo(scenario, 150, vary=VARY, out=tmp_path, threads=1, progress=interrupt)
    kept = read_campaign(tmp_path).num_rows
    resumed = montecarlo(scenario, 150, vary=VARY, out=tmp_path)
    assert 0 < kept < 150 and resumed.runs_now == 150 - kept
    assert resumed.table.equals(whole)


def test_a_lost_part_is_done_again(scenario, whole, tmp_path):
    montecarlo(scenario, 150, vary=VARY, out=tmp_path)
    next(tmp_path.glob("part-*.parquet")).unlink()
    assert montecarlo(scenario, 150, vary=VARY, out=tmp_path).table.equals(whole)


def test_leftovers_of_a_killed_process_are_removed(scenario, tmp_path):
    montecarlo(scenario, 1, out=tmp_path)
    left = tmp_path / ".part-000000001.parquet.0123.new.parquet"
    left.write_text("half")
    montecarlo(scenario, 1, out=tmp_path)
    assert not left.exists()


def test_another_plan_in_the_folder_is_refused(scenario, tmp_path):
    montecarlo(scenario, 1, out=tmp_path)
    with pytest.raises(InputError, match=r"another campaign lies there, its runs is 1, not 2"):
        montecarlo(scenario, 2, out=tmp_path)


def test_rows_of_other_code_are_not_mixed(scenario, tmp_path):
    montecarlo(scenario, 1, out=tmp_path)
    plan = (tmp_path / "campaign.yaml").read_text()
    code = make_plan(scenario, 1, {}, ({},), 0).code["omni_multirate"]
    (tmp_path / "campaign.yaml").write_text(plan.replace(code, "0" * len(code)))
    with pytest.raises(InputError, match=r"computed by other code \('omni_multirate'\), expected the same version"):
        montecarlo(scenario, 1, out=tmp_path)


@pytest.mark.parametrize("damage", ["cut", "bytes"])
def test_a_damaged_part_is_named_and_computed_again(scenario, tmp_path, damage):
    whole = montecarlo(scenario, 2, out=tmp_path)
    part = tmp_path / "part-000000000.parquet"
    data = bytearray(part.read_bytes())
    if damage == "cut":
        del data[len(data) // 2 :]
    else:
        data[-200:-8] = b"\xff" * 192
    part.write_bytes(data)
    with pytest.raises(InputError, match=r"part-000000000\.parquet: cannot be read"):
        read_campaign(tmp_path)
    again = montecarlo(scenario, 2, out=tmp_path)
    assert again.table.equals(whole.table) and again.runs_now == 2
    assert [file.name for file in again.damaged] == ["part-000000000.damaged"]
    assert montecarlo(scenario, 2, out=tmp_path).damaged == []


def test_two_campaigns_do_not_write_into_one_folder(scenario, tmp_path):
    said = []

    def second(done, total):
        with pytest.raises(InputError, match="another campaign is writing there"):
            montecarlo(scenario, 1, out=tmp_path)
        said.append(done)

    montecarlo(scenario, 1, out=tmp_path, progress=second)
    assert said


@pytest.mark.parametrize("runs", [0, 1_000_001, 2_000_000])
def test_no_runs_or_more_than_a_million_are_refused(scenario, runs):
    with pytest.raises(InputError, match=f"--runs: expected 1 to 1000000 runs, got {runs}"):
        make_plan(scenario, runs, {}, ({},), 0)


# -- a cluster -----------------------------------------------------------------------------------------------------


def test_a_cluster_without_dask_names_the_extra(scenario, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "dask.distributed", None)
    with pytest.raises(InputError, match=r"pip install drake_ispace\[cluster\]"):
        montecarlo(scenario, 1, cluster="tcp://127.0.0.1:8786")


@pytest.mark.parametrize("options", [{"cluster": "here"}, {"cluster": "tcp://127.0.0.1:8786", "threads": 2}])
def test_what_is_no_cluster_is_refused(scenario, options):
    pytest.importorskip("dask.distributed", reason="needs the extra [cluster]: dask, distributed")
    with pytest.raises(InputError, match="expected"):
        montecarlo(scenario, 1, **options)


@pytest.mark.slow
def test_a_cluster_of_two_processes_gives_the_same_table(scenario, whole, tmp_path):
    distributed = pytest.importorskip("dask.distributed", reason="needs the extra [cluster]: dask, distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        montecarlo(scenario, 150, vary=VARY, out=tmp_path, cluster=cluster.scheduler_address)
    assert read_campaign(tmp_path).equals(whole)


def test_rows_that_were_taken_while_ctrl_c_came_are_counted(tmp_path):
    rows = Rows(pa.schema([("run", pa.int64())]), tmp_path)
    rows.add([{"run": number} for number in range(3)])
    rows.done = {0}  # the count was interrupted
    rows.flush()
    assert rows.done == {0, 1, 2}
