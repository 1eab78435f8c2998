"""The paths on which the measured wheels take models, beside the camera's fixes."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.errors.free_run import Simulation, windows_of
from drake_ispace.explain.prove.errors.paths import compose, relative
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.scenario import Scenario


def reckoned(models: Sequence[Scenario], recording: Recording) -> list[Channel] | None:
    """The camera's fixes, then what each model says of them, as channels "kinect" on the clock of the prediction.

    All paths begin at one pose, as those of the gap do: the last model's, estimated from the first second.

    Returns:
        None where the run has no encoder or no fixes, or where a model cannot predict it.
    """
    if not {"encoder", "kinect"} <= recording.channels.keys():
        return None
    try:
        predictions = [prepare(model, recording).prediction for model in models]
    except InputError:
        return None
    track, start = predictions[0].tracks[0], windows_of(predictions[-1], 0, {}).start
    if len(track.fix_t) < 2:
        return None
    return [_channel(track, track.poses), *(_channel(track, _path(one, start)) for one in predictions)]


def _path(prediction: Prediction, start: np.ndarray) -> np.ndarray:
    path = Simulation(prediction.replay, prediction.tracks[0], prediction.starts[0], {}).reckoned
    return compose(start, relative(path[0], path[1:]))


def _channel(track, poses):
    return Channel(np.asarray(track.fix_t), ("x", "y", "phi"), poses, {}, None)
