"""A counter may have begun long before a run: what encoders lack is lacking since then, not at once."""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.counts import count_of
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.case import prepare
from drake_ispace.files.recording import Channel, Recording
from explain.test_own_drives import model as drive
from hidden import two_wheels
from hidden.generator import generate

LACKING = {"encoder_scale": {"share": 0.03}, "encoder_lost_counts": {"wheel": 1, "share": 0.05}}
LATER = 4096  # counts


def own_run():
    t = 0.01 * np.arange(300)
    torque = np.where(t < 1.5, 0.02, -0.02)
    rate = np.concatenate([[0.0], np.cumsum(0.01 * torque[:-1] / 0.01)])
    angle = np.concatenate([[0.0], np.cumsum(0.01 * 0.5 * (rate[:-1] + rate[1:]))])
    counted = 0.01 * np.floor(angle / 0.01)
    return Recording("drive", channels={
        "torque": Channel(t, ("tau_1",), torque[:, None], {}, 0.01),
        "encoder": Channel(t, ("theta_1",), counted[:, None], {}, 0.01),
    })


def later(recording):
    """The recording of a robot whose counters did not begin at zero."""
    encoder = recording.channels["encoder"]
    moved = replace(encoder, values=encoder.values + LATER * count_of(encoder.values))
    return replace(recording, channels=recording.channels | {"encoder": moved})


@pytest.mark.first_case
@pytest.mark.parametrize(("model", "run"), [
    ("omni_multirate", lambda: generate("omni", "square", {}, 4.0, 1)),
    ("pendulum_multirate", lambda: generate("pendulum", "square", {}, 4.0, 1)),
    (two_wheels.model(), lambda: two_wheels.drive(1, 6.0)),
    (drive(0.01), own_run),
], ids=["omni", "pendulum", "two wheels", "own"])
def test_what_encoders_lack_has_nothing_to_do_with_where_their_counters_began(model, run):
    recording = run()
    one, other = (prepare(model, [r]).prediction for r in (recording, later(recording)))
    effects = LACKING if not isinstance(model, OwnModel) else {"encoder_scale": LACKING["encoder_scale"]}
    (here,), (there,) = (prediction.residuals(effects) for prediction in (one, other))
    assert all(np.allclose(here[name], there[name], atol=1e-6) for name in here)
    assert not np.allclose(one.residuals(effects)[0]["motion"], one.residuals({})[0]["motion"], atol=1e-4)


@pytest.mark.slow
def test_a_wheel_that_loses_counts_is_not_called_a_larger_one():
    hidden = {"encoder_lost_counts": {"wheel": 2, "share": 0.03}}
    runs = di.hide("omni_multirate", "omni", hidden, ["square", "figure_eight", "circle"], 1, 12.0)
    few = [di.effects()[name] for name in ("encoder_lost_counts", "single_wheel_radius_error", "wheel_radius_error")]
    answer = di.explain("omni_multirate", [later(run) for run in runs.values()], effects=few)
    assert [effect.name for effect in answer.effects] == ["encoder_lost_counts"]
