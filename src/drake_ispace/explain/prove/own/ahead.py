"""What the model of a user's own plant does not predict from one read of its encoders to the next.

Play in a gear or a loose coupling add nothing up over a run, so that a simulation of the whole is hardly off. What the
filter could not predict is therefore compared with what encoders, and unknown torques as strong as the model assumes,
leave of it.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.own_replay import OwnReplay
from drake_ispace.explain.predict.prediction import Prediction, change
from drake_ispace.explain.prove.errors.free_run import PREDICTION, STEP, Errors, Measure, rms
from drake_ispace.explain.prove.noise.noise import DRAWS
from drake_ispace.explain.threads import each

AHEAD = Measure(PREDICTION, STEP, "encoder: wheel angle", "rad", "torque")


class Ahead:
    """Predictions of angles, one read ahead, while all wheels turn.

    Args:
        prediction: model and runs. point: effects of the answer.
    """

    def __init__(self, prediction: Prediction, point: Point):
        self._prediction, self._values = prediction, merged(point)
        self._turning = [classes["motion"] > 0 for classes in prediction.classes(self._values)]

    @staticmethod
    def may_judge(replay: OwnReplay) -> bool:
        """Whether the filter has all of the plant's numbers, which it takes as they are given, and measured angles.

        Angles that were made of logged speeds are as far off as all noise before them adds up to.
        """
        return not replay.free and replay.logged == "angle"

    def errors(self, point: Point) -> list[Errors]:
        """For each run, AHEAD -> (k, 1) angles less their predictions [rad]; empty if a wheel rests all the time.

        point: effects in the model.
        """
        of_runs = self._of_turning(self._prediction.residuals(merged(point)))
        return [{AHEAD: rows} if len(rows) else {} for rows in of_runs]

    def noise(self, seed: int) -> list[Mapping[Measure, float]]:
        """AHEAD -> root mean square error of such a prediction [rad] that the encoders' noise causes, and the same for
        unknown torques as strong as the model assumes.

        seed: of the draws.
        """
        replay, as_given = self._prediction.replay, self._prediction.residuals(self._values)

        def counted(track, seeds):
            more = replay.angle_std * np.random.default_rng(seeds).standard_normal(track.measured.shape)
            return replace(track, measured=track.measured + more)

        def changed(disturbed, number, draw):
            tracks = [disturbed(track, [seed, number, i, draw]) for i, track in enumerate(self._prediction.tracks)]
            after = replace(self._prediction, tracks=tracks).residuals(self._values)
            return rms(self._of_turning(list(map(change, after, as_given))))

        sources = counted, replay.disturbed
        jobs = [(disturbed, number, draw) for number, disturbed in enumerate(sources, 6) for draw in range(DRAWS)]
        squares = np.square(each(lambda job: changed(*job), jobs)).reshape(len(sources), DRAWS)
        return [{AHEAD: float(size)} for size in np.sqrt(squares.mean(axis=1))]

    def _of_turning(self, residuals):
        """(k, 1) residuals of each run while all of its wheels turn."""
        return [run["motion"][rows].reshape(-1, 1) for run, rows in zip(residuals, self._turning, strict=True)]
