"""Motion that the training runs lack: what shows in it alone, no size can be fitted to."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.answer.sentences import run_name
from drake_ispace.explain.decide.survey.generic import motion_of
from drake_ispace.explain.predict.case import Case
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.prove.errors.repeats import SAME_MOTION

_AXES = ("driving ahead and back", "moving sideways", "turning")


def advise_missing_motion(answer: Explanation, case: Case) -> None:
    """Say what to train on, where most of what is left is in a held-out run that moves as training runs hardly do."""
    if case.held_out is None or case.scenario is None or answer.verdict not in ("incomplete", "unknown"):
        return
    most = dict.fromkeys(name for remainder in answer.remainders for name in remainder.runs[:1])
    tracks = {track.name: track for track in case.held_out.tracks}
    trained = shares_of_motion(case.prediction, case.prediction.tracks)
    for track in (tracks[name] for name in most if name in tracks):
        unseen = shares_of_motion(case.held_out, [track])
        if axes := [_AXES[i] for i in np.flatnonzero((unseen >= SAME_MOTION) & (trained < SAME_MOTION * unseen))]:
            besides = f"; {answer.next_experiment}" if answer.effects and answer.next_experiment else ""
            answer.next_experiment = (
                f"train on {' and on '.join(axes)} as well: training runs hardly do so, and most is left in "
                f"{run_name(track.name)}, which does{besides}"
            )
            return


def shares_of_motion(prediction: Prediction, tracks: Sequence[Track]) -> np.ndarray:
    """(3,) by motion ahead, sideways and by turning: shares of the squared speed of the wheels."""
    squares = np.mean(np.vstack([motion_of(prediction, track).body for track in tracks]) ** 2, axis=0)
    of_wheels = squares * np.sum(prediction.replay.body.plant.geometry.inverse**2, axis=0)
    return of_wheels / max(of_wheels.sum(), 1e-300)
