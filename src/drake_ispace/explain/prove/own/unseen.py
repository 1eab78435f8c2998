"""Effects of an answer about a user's own plant that unseen runs rule out.

Several effects together can come near to something that none of them is. Each run then asks for other sizes of them,
and from one read of the encoders to the next an unseen run is likelier without one of them, by as much as would rule
out a rival.
"""

from drake_ispace.explain.decide.decision import MARGIN
from drake_ispace.explain.decide.survey.view import view_from
from drake_ispace.explain.fit.likelihood import Point, deviance_at, merged
from drake_ispace.explain.predict.prediction import Prediction


def ruled_out(unseen: Prediction, point: Point) -> list[str]:
    """Names of effects without which unseen runs are clearly likelier, the worst first; the others keep their sizes.

    unseen: model and runs. point: effects of the answer.
    """
    residuals = unseen.residuals(merged(point))
    view = view_from(unseen, point, list(point), residuals, generics=lambda *view: [])
    likelihood = view.likelihood(point, residuals, near=False)
    rests = {effect: {other: z for other, z in point.items() if other is not effect} for effect in point}
    with_all = deviance_at(likelihood, point)
    further = {effect.name: with_all - deviance_at(likelihood, rest) for effect, rest in rests.items()}
    return sorted((name for name in further if further[name] > MARGIN), key=further.get, reverse=True)
