"""A robot of which nothing is known but that a torque turns its wheels."""

import numpy as np

from drake_ispace.effects.effect import Body
from drake_ispace.explain.own_model import OwnPlant, OwnRobot


def rail(wheels=1):
    return Body(OwnRobot("rail", wheels), OwnPlant(None, np.zeros((wheels, wheels))), wheels)
