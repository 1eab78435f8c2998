"""An effect of somebody else's, given to `explain` and registered nowhere."""

import runpy
from unittest import mock

from drake_ispace.effects.library import library
from drake_ispace.explain.explain import explain
from drake_ispace.hiding import hide
from drake_ispace.scenario import load_scenario


def test_it_is_named_and_that_no_model_can_list_it_is_said(own_effect_file):
    (own,) = runpy.run_path(str(own_effect_file))["EFFECTS"]
    scenario = load_scenario("omni_multirate")
    with mock.patch.dict(library(), {own.card.name: own}):
        runs = hide(scenario, "omni", {"torque_fade": {"loss_s_rad": 0.02}}, ["square", "figure_eight"], seconds=5.0)
    rivals = [library()[name] for name in ("mass_error", "viscous_friction")]
    found = explain(scenario, list(runs.values()), effects=[own, *rivals])
    assert [effect.name for effect in found.effects] == ["torque_fade"]
    assert found.model is None and any("torque_fade: no entry point" in warning for warning in found.warnings)
