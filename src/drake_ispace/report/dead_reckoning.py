"""The path on which the measured wheels take a model, as the camera would have seen it."""

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.free_run import Simulation, windows_of
from drake_ispace.explain.prove.paths import compose, relative
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.scenario import Scenario


def reckoned(model: Scenario, recording: Recording) -> Channel | None:
    """The channel "kinect" of the dead-reckoned run, from a start that is estimated from its first second.

    Returns:
        None where the run has no encoder or no fixes, or where the model cannot predict it.
    """
    if not {"encoder", "kinect"} <= recording.channels.keys():
        return None
    try:
        prediction = prepare(model, recording).prediction
    except InputError:
        return None
    (track,) = prediction.tracks
    path = Simulation(prediction.replay, track, prediction.starts[0], {}).reckoned
    poses = compose(windows_of(prediction, 0).start, relative(path[0], path[1:]))
    return Channel(np.asarray(track.fix_t), ("x", "y", "phi"), poses, {}, None)
