"""Parameters as coordinates of a fit: limits by their reciprocals, and where signatures are taken."""

import math

from drake_ispace.effects.card import Parameter
from drake_ispace.explain.fit.candidates import Candidate, coordinate, probes, value_of
from stand_ins.tried import candidate

PLAIN = Parameter("share", "1", 0.0, -0.5, 0.5, (0.1, 2.0))
LIMIT = Parameter("limit", "N*m", math.inf, 0.1, math.inf, (0.5, 2.0), scale="torque", reciprocal=True)


class Cause:
    name = "cause"


CAUSE = Candidate(Cause(), (("wheel", 2),), (PLAIN, LIMIT), 4)


def test_a_plain_parameter_is_its_own_coordinate():
    assert coordinate(PLAIN, -0.3) == -0.3 and value_of(PLAIN, -0.3) == -0.3


def test_a_limit_has_its_reciprocal_as_coordinate():
    assert coordinate(LIMIT, 4.0) == 0.25 and value_of(LIMIT, 0.25) == 4.0
    assert coordinate(LIMIT, math.inf) == 0.0 and coordinate(LIMIT, 0.0) == math.inf
    assert value_of(LIMIT, 0.0) == math.inf and value_of(LIMIT, -1.0) == math.inf


def test_where_an_effect_changes_nothing_and_how_far_it_goes():
    assert CAUSE.neutral == [0.0, 0.0]
    assert CAUSE.bounds == [(-0.5, 0.5), (0.0, 10.0)]


def test_values_have_the_chosen_wheel_and_every_parameter():
    assert CAUSE.values([0.2, 0.5]) == {"wheel": 2, "share": 0.2, "limit": 2.0}
    assert CAUSE.label == "cause[2]"


def test_probes_are_of_the_size_of_the_motion_and_within_bounds():
    assert probes(CAUSE, {"torque": 4.0}) == [[0.1, 0.0], [0.5, 0.0], [0.0, 0.5], [0.0, 0.125]]
    assert probes(CAUSE, {})[2:] == [[0.0, 2.0], [0.0, 0.5]]


def test_a_probe_stands_on_top_of_a_neutral_value_that_is_not_zero():
    late = Candidate(Cause(), (), (Parameter("gain", "1", 1.0, 0.0, 3.0, (0.25,)),))
    assert late.neutral == [1.0] and probes(late, {}) == [[1.25]]
    assert probes(Candidate(Cause(), (), (Parameter("x", "1", math.inf, 0.0, 9.0, (0.25,)),)), {}) == [[0.25]]


def test_presliding_friction_is_coulomb_friction_where_its_reach_is_least():
    presliding, coulomb = candidate("presliding_friction"), candidate("coulomb_friction")
    assert presliding.generalises(coulomb) and not coulomb.generalises(presliding)
    assert presliding.has_become_another([0.01, 0.05]) and not presliding.has_become_another([0.01, 0.06])
    assert not candidate("stribeck_friction").has_become_another([0.01, 0.05])


def test_a_tolerance_goes_with_its_scale():
    friction = Parameter("torque_n_m", "N m", scale="torque", tolerance=0.1)
    tolerant = Candidate(Cause(), (), (PLAIN, friction))
    assert tolerant.tolerances({"torque": 2.0}) == [0.0, 0.2] and tolerant.tolerances({}) == [0.0, 0.1]


def test_a_fit_goes_no_further_than_bounds_and_sums_allow():
    own, extra = Parameter("own_s", "s", low=0.0, high=1.0), Parameter("extra_s", "s", low=-1.0, added_to="own_s")
    both = Candidate(Cause(), (), (own, extra))
    assert both.within([0.2, -0.1]) == [0.2, -0.1] and both.within([2.0, 3.0]) == [1.0, 3.0]
    assert both.within([0.2, -0.5]) == [0.2, -0.2] and both.within([-0.3, -0.5]) == [0.0, 0.0]
