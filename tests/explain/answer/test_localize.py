"""Where a disagreement shows: in the channel that the hidden effect moves, and its shares add up."""

import pytest

from drake_ispace.effects.library import library
from drake_ispace.explain.explain import explain
from drake_ispace.hiding import hide
from drake_ispace.scenario import load_scenario
from stand_ins.tried import FEW


def shows_in(places, channel):
    """Whether the channel, of one wheel or of all, has most of what shows, and is first of the list."""
    shares = [place.share for place in places]
    # a channel that the explanation makes a little worse has a negative share, and is not listed
    assert shares == sorted(shares, reverse=True) and 0.9 < sum(shares) < 1.2
    assert sum(place.share for place in places if place.channel.startswith(channel)) > 0.7
    assert places[0].channel.startswith(channel) and places[0].driver
    return True


def test_the_one_effect_that_is_tried_shows_in_its_channel_and_goes_with_what_drives_it():
    """Others are tried below."""
    model = load_scenario("omni_multirate")
    viscous = {"viscous_friction": {"coefficient_n_m_s": 0.001}}
    runs = list(hide(model, "omni", viscous, ["square", "trapezium"], seconds=7.0).values())
    places = explain(model, runs, effects=[library()["viscous_friction"]]).localization
    assert shows_in(places, "encoder") and places[0].driver == "speed"


@pytest.mark.slow
@pytest.mark.parametrize(("name", "values", "channel"), [
    pytest.param(  # the wheels turn as told, the robot gets elsewhere
        "wheel_radius_error", {"share": 0.03}, "kinect", marks=pytest.mark.slow,
    ),
    ("floor_tilt", {"slope_x_rad": 0.03}, "encoder"),  # the robot is pushed, and its wheels with it
])
def test_it_shows_in_the_channel_that_the_effect_moves(name, values, channel):
    model = load_scenario("omni_multirate")
    runs = list(hide(model, "omni", {name: values}, ["square", "figure_eight"], seconds=10.0).values())
    assert shows_in(explain(model, runs, effects=FEW).localization, channel)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "values", "driver"), [
    pytest.param("viscous_friction", {"coefficient_n_m_s": 0.001}, "speed", marks=pytest.mark.slow),
    pytest.param("coulomb_friction", {"torque_n_m": 0.01}, "direction", marks=pytest.mark.slow),
    ("mass_error", {"share": 0.3}, "acceleration"),
])
def test_it_goes_with_what_drives_the_effect_though_the_command_reacts_to_all(name, values, driver):
    model = load_scenario("omni_multirate")
    runs = list(hide(model, "omni", {name: values}, ["square", "trapezium"], seconds=7.0).values())
    found = explain(model, runs, effects=FEW)
    assert found.localization[0].channel.startswith("encoder") and found.localization[0].driver == driver
