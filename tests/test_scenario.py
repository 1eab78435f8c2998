"""Scenarios: the thesis's tables as defaults, packaged files, overrides, and the way to YAML and back."""

import dataclasses

import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import MAX_TICK, TICK_S, VISION_S, ticks_in
from drake_ispace.files.yaml_guard import dump_yaml, load_yaml
from drake_ispace.scenario import (
    Scenario,
    blaming,
    difference,
    load_scenario,
    read,
    scenario_names,
    to_data,
    with_option,
)
from drake_ispace.wiring.catalog import CATALOG, build_diagram

# Dotted key -> value as printed in the thesis, except where the comment says otherwise.
TABLES = {
    "Table 2.1": {
        "pendulum.plant.body_mass_kg": 3.5, "pendulum.plant.wheel_mass_kg": 0.25,
        "pendulum.plant.body_inertia_pitch_kg_m2": 8.5e-4, "pendulum.plant.body_inertia_yaw_kg_m2": 0.0255,
        "pendulum.plant.wheel_inertia_kg_m2": 0.0013, "pendulum.plant.rotor_inertia_kg_m2": 1.6e-5,
        "pendulum.plant.centre_of_gravity_m": 0.04, "pendulum.plant.wheel_radius_m": 0.08,
        "pendulum.plant.gear_ratio": 1.0 / 400.0,
        "pendulum.plant.half_track_m": 0.4 / 2.0,  # printed: the whole width
    },
    "Table 2.2": {
        "omni.plant.mass_kg": 7.31, "omni.plant.wheel_inertia_kg_m2": 0.1e-5, "omni.plant.wheel_radius_m": 0.024,
        "omni.plant.wheel_distance_m": 0.36, "omni.encoder.counts_per_turn": 12 * 9,
        "omni.plant.inertia_kg_m2": 7.29e-2,  # printed: 7.29e-5, which no robot of this size can have
    },
    "Table 4.2": {
        "pendulum.plant.friction.coulomb_n_m": 0.0061, "pendulum.plant.friction.viscous_n_m_s": 0.0106,
        "pendulum.control.friction_compensation.coulomb_n_m": 0.0061,
        "pendulum.control.friction_compensation.viscous_n_m_s": 0.0106,
    },
    "Table 5.1 and section 5.4": {
        "space.localizer.pixel_m": [4.87e-3, 5.51e-3], "space.width_m": 2.5, "space.depth_m": 2.0,
    },
    "(6.26), (6.27)": {"omni.control.k_p": [2.45, 2.45, 1.23], "omni.control.k_d": [10.0, 10.0, 4.0]},
    "(6.42), (6.43)": {
        "pendulum.control.k_right": [0.4351, -0.2217], "pendulum.control.f1_right": [1.3328, 0.5548, -0.0843, 0.2023],
    },
    "section 6.8.2": {"omni.trajectory.speed_m_s": 0.25, "pendulum.trajectory.speed_m_s": 0.25},
}
ROWS = [(table, key, value) for table, rows in TABLES.items() for key, value in rows.items()]


def at(data, key):
    for part in key.split("."):
        data = data[part]
    return data


@pytest.mark.parametrize("table, key, value", ROWS, ids=[f"{table}-{key}" for table, key, _ in ROWS])
def test_defaults_are_those_of_the_thesis(table, key, value):
    assert at(to_data(Scenario()), key) == value


def test_rates_are_those_of_table_6_1():
    assert pytest.approx(0.005, rel=1e-9) == TICK_S and pytest.approx(0.095, rel=1e-9) == VISION_S


def test_the_space_is_what_the_camera_sees():
    pixel_x, pixel_y = Scenario().space.localizer.pixel_m
    assert (513 * pixel_x, 363 * pixel_y) == (pytest.approx(2.5, abs=0.01), pytest.approx(2.0, abs=0.01))


def test_two_scenarios_share_no_list():
    first, second = Scenario(), Scenario()
    first.omni.control.q[0] = 1.0
    first.pendulum.plant.slip.ratio[0] = 0.5
    assert second == Scenario() != first


# ---------------------------------------------------------------------------------------------------- packaged files


@pytest.mark.parametrize("name", scenario_names())
def test_every_packaged_scenario_builds_its_diagram(name):
    scenario = load_scenario(name)
    assert build_diagram(scenario).get_name() == scenario.diagram


def test_every_diagram_has_a_scenario_of_its_name():
    assert set(CATALOG) <= set(scenario_names())
    assert all(load_scenario(name).diagram == name for name in CATALOG)


@pytest.mark.parametrize("name", [name for name in scenario_names() if name.endswith("_as_printed")])
def test_a_variant_as_printed_differs_from_the_defaults(name):
    assert set(difference(load_scenario(name))) - {"diagram", "seconds"}


# -------------------------------------------------------------------------------------------------- to YAML and back


@pytest.mark.parametrize("name", scenario_names())
def test_the_difference_written_as_yaml_gives_the_same_scenario(name):
    scenario = load_scenario(name)
    text = dump_yaml(difference(scenario))
    assert read(Scenario(), load_yaml(text, "text"), "text") == scenario


def test_the_whole_tree_written_as_yaml_gives_the_same_scenario():
    overrides = ["pendulum.initial_pose=[0.1, -0.2, 1e-7]", "omni.encoder.velocity=raw"]
    scenario = load_scenario("pendulum_multirate", overrides)
    assert read(Scenario(), load_yaml(dump_yaml(to_data(scenario)), "text"), "text") == scenario


def test_the_difference_of_the_defaults_is_the_name_of_the_diagram():
    assert difference(Scenario()) == {"diagram": "omni_multirate"}


def test_the_difference_names_only_what_was_changed():
    scenario = load_scenario("omni_multirate", ["omni.plant.mass_kg=8", "seed=3"])
    assert difference(scenario) == {"diagram": "omni_multirate", "seed": 3, "omni": {"plant": {"mass_kg": 8.0}}}


def test_a_file_overrides_only_what_it_names(tmp_path):
    (tmp_path / "mine.yaml").write_text("diagram: pendulum_multirate\npendulum: {plant: {body_mass_kg: 4}}\n")
    expected = Scenario(diagram="pendulum_multirate")
    expected.pendulum.plant.body_mass_kg = 4.0
    assert load_scenario(str(tmp_path / "mine.yaml")) == expected


def test_a_section_without_a_value_changes_nothing(tmp_path):
    (tmp_path / "mine.yaml").write_text("seed: 3\nomni:\n  plant:\n    # mass_kg: 8\npendulum:\n")
    assert load_scenario(str(tmp_path / "mine.yaml")) == Scenario(seed=3)


# --------------------------------------------------------------------------------------------------------- overrides


def test_overrides_act_in_order():
    assert load_scenario("omni_multirate", ["seed=1", "seed=2"]).seed == 2
    assert load_scenario("omni_multirate", [f"seed={'0' * 4301}7"]).seed == 7
    overrides = ["omni.plant={mass_kg: 1.0, wheel_radius_m: 0.03}", "omni.plant.mass_kg=2"]
    plant = load_scenario("omni_multirate", overrides).omni.plant
    assert (plant.mass_kg, plant.wheel_radius_m) == (2.0, 0.03)


@pytest.mark.parametrize("text, value", [("8", 8.0), ("8.5", 8.5), ("8e0", 8.0), (" 8 ", 8.0), ("+8.", 8.0)])
def test_a_number_may_be_written_in_many_ways(text, value):
    mass = load_scenario("omni_multirate", [f"omni.plant.mass_kg={text}"]).omni.plant.mass_kg
    assert mass == value and isinstance(mass, float)


def test_what_rounding_leaves_of_nothing_is_nothing():
    friction = load_scenario("pendulum_multirate", ["pendulum.plant.friction.coulomb_n_m=2.2e-17"]).pendulum.plant
    assert friction.friction.coulomb_n_m == 0.0
    with pytest.raises(InputError, match="expected a size between"):
        load_scenario("omni_multirate", ["omni.plant.mass_kg=2.2e-17"])


def test_null_takes_an_optional_value_away():
    overrides = ["omni.actuator.limit_n_m=0.5", "omni.actuator.limit_n_m=null"]
    assert load_scenario("omni_multirate", overrides).omni.actuator.limit_n_m is None


def test_a_path_of_a_file_may_hold_an_equals_sign():
    overrides = ["omni.trajectory.kind=polyline", "omni.trajectory.csv=a=b.csv"]
    assert load_scenario("omni_multirate", overrides).omni.trajectory.csv == "a=b.csv"


def test_an_override_does_not_change_what_it_overrides():
    first = load_scenario("omni_multirate")
    read(first, {"omni": {"plant": {"mass_kg": 1.0}}}, "test")
    assert first == load_scenario("omni_multirate")


def test_a_start_inside_of_a_larger_space_is_fine():
    overrides = ["omni.initial_pose=[2.5, 0, 0]", "space.width_m=6"]
    assert load_scenario("omni_multirate", overrides).omni.initial_pose == [2.5, 0.0, 0.0]


def test_an_option_is_checked_as_the_key_of_its_name():
    assert with_option(Scenario(), "seconds", 5).seconds == 5.0
    with pytest.raises(InputError, match=r"^--seconds: expected at least 0.005 \[s\], got -1$"):
        with_option(Scenario(), "seconds", -1.0)


def test_the_longest_run_ends_at_the_last_tick_whose_time_is_exact():
    longest = with_option(Scenario(), "seconds", MAX_TICK * TICK_S)
    assert ticks_in(longest.seconds) == MAX_TICK
    with pytest.raises(InputError, match="at most"):
        with_option(Scenario(), "seconds", (MAX_TICK + 1) * TICK_S)


def test_every_number_has_a_rule_or_may_be_anything():
    """The walk that checks a tree knows every kind of field in it."""

    def fields(tree):
        for entry in dataclasses.fields(tree):
            value = getattr(tree, entry.name)
            yield from fields(value) if dataclasses.is_dataclass(value) else [entry]

    kinds = {str(entry.type) for entry in fields(Scenario())}
    plain = {str(kind) for kind in (bool, int, float, str, dict, list[int], list[float], list[str], list[list[float]])}
    optional = {str(kind) for kind in (int | None, float | None, str | None, list[float] | None)}
    assert kinds <= plain | optional


def test_blame_names_the_scenario():
    with pytest.raises(InputError, match=r"^mine: omni: no$"), blaming("mine"):
        raise InputError("omni: no")
