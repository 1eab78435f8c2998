"""How well runs agree on which of two fits comes nearer to the robot."""

import numpy as np

from drake_ispace.explain.decide.survey.survey import Survey
from drake_ispace.explain.fit.likelihood import Fit
from drake_ispace.robots.robot import COMMAND


def scatter(survey: Survey, better: Fit, other: Fit) -> float:
    """By how much leads of one fit over another scatter more than noise makes them; at least 1.

    Were the better fit right, its lead in a run would be l, the squared distance of the fits in that run, within a
    variance of 4 l. A robot of another form lies nearer to one fit in some runs and to the other one in others, or
    between the two in all of them. Leads then say less, as if the variance of the noise were larger by this factor.

    Where velocity is commanded it is 1: there the place decides, in which adds up what hardly shows from one sample to
    the next, so that leads from sample to sample scatter whichever fit is right.

    survey: gives the noise, under which both were fitted.
    """
    if survey.view.prediction.replay.body.robot.driven == COMMAND:
        return 1.0
    apart = other.w - better.w
    distances = np.bincount(survey.runs, apart * survey.likelihood.marginalised(apart))
    excess, usual = leads(survey, better, other) - distances, 4.0 * max(float(distances.sum()), 1e-300)
    return max(1.0, float(np.sum(excess**2)) / usual, float(np.sum(excess)) ** 2 / usual)


def leads(survey: Survey, better: Fit, other: Fit) -> np.ndarray:
    """(runs,) by how much the deviance of each run is larger at the other fit; survey: as of `scatter`."""
    likelihood = survey.likelihood
    return np.bincount(survey.runs, likelihood.parts(other.w) - likelihood.parts(better.w))
