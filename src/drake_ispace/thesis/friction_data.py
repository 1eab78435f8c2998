"""Data for the friction coefficients, Fig. 4.2, and each method's way from a run to C_cu and C_v."""

import itertools

import numpy as np

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.feedback.balance_gains import linearised
from drake_ispace.control.feedback.dlqr import dlqr
from drake_ispace.files.recording import Recording
from drake_ispace.robots.pendulum import Pendulum
from drake_ispace.rollout.compile import Rollout, compile_diagram
from drake_ispace.scenario import Scenario
from drake_ispace.simulation import first_divergence, make_run
from drake_ispace.thesis.friction_coefficients import friction_coefficients
from drake_ispace.thesis.methods.armax import armax
from drake_ispace.thesis.methods.armaxd import armaxd
from drake_ispace.thesis.methods.arx import arx
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.methods.instrumental import instrumental
from drake_ispace.thesis.methods.prediction_error import prediction_error, silence
from drake_ispace.thesis.motion_follower import following_diagram, measured_motion
from drake_ispace.thesis.structures import Problem, friction_problem
from drake_ispace.wiring.catalog import build_diagram

#: The names of the plant's coefficients in a rollout.
COEFFICIENTS = tuple(f"{Pendulum.name}_plant.friction.{name}" for name in ("coulomb", "viscous"))
#: At 200 Hz the separator's 740 Hz means nothing; the same share of the rate.
CUT_OFF_HZ = 74.0
_Q, _R = [5e3, 1e3, 800.0, 50.0, 100.0, 1e3], [1e4, 1e4]  # of the follower: (6.40), (6.41)
_SETTLED = 100  # ticks
_GRID = (0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2)


def friction_rollout(scenario: Scenario) -> Rollout:
    """The compiled Diagram of `scenario`, all outputs logged.

    Raises:
        InputError: its plant has no friction to be identified.
    """
    rollout = compile_diagram(build_diagram(scenario))
    for name in COEFFICIENTS:
        if name not in rollout.parameter_names:
            raise InputError(f"the Diagram {scenario.diagram} has no parameter {name}, expected the nonlinear pendulum")
    return rollout


def run_recording(rollout: Rollout, scenario: Scenario, ticks: int, parameters: np.ndarray) -> Recording:
    """One rollout as a recording.

    Raises:
        InputError: the robot fell.
    """
    logs = rollout.run(ticks, parameters)
    lost = first_divergence(logs, scenario.space)
    if lost is not None:
        raise InputError(f"the simulated robot fell or was lost at {lost * TICK_S:.2f} s, expected one that balances")
    return to_recording(make_run(scenario, logs, None, 0.0), Pendulum.name)


def friction_instruments(rollout: Rollout, scenario: Scenario, samples: int):
    """A function theta -> noise-free regressors (samples, 4), for the refined instrumental variables."""
    base = silence(rollout)
    names = ("theta", "sgn", "omega", "tau")

    def simulate(theta):
        column = Estimate("", names, ("s", "theta"), theta, np.ones_like(theta), np.empty((0, 2)), np.empty((0, 4)))
        found = friction_coefficients(column)
        base[rollout.index(COEFFICIENTS[0])] = np.clip(found.coulomb_n_m, 0.0, 0.05)
        base[rollout.index(COEFFICIENTS[1])] = np.clip(found.viscous_n_m_s, 0.0, 0.05)
        regressor = friction_problem(run_recording(rollout, scenario, samples + 2, base)).regressor
        return regressor[:samples]

    return simulate


def following_rollout(scenario: Scenario) -> Rollout:
    """The compiled plant of `scenario` held on a measured motion, for `friction_prediction_error`."""
    plant = scenario.pendulum.plant
    a, b = linearised(plant)
    return compile_diagram(following_diagram(plant, dlqr(a, b, _Q, _R, TICK_S)))


def friction_prediction_error(
    follower: Rollout, scenario: Scenario, recording: Recording, start=(0.005, 0.01)
) -> Estimate:
    """C_cu and C_v that need the least correction to keep the simulated plant on the run (`motion_follower`).

    The speed over which the plant's sign turns is the scenario's and not fitted.

    Args:
        follower: of `following_rollout`; start: first guess, within a factor of 2 or so.

    Raises:
        InputError: a channel that is missing or has gaps, or a run that does not start at t = 0.
    """
    plant = scenario.pendulum.plant
    measured = measured_motion(recording, plant.wheel_radius_m, plant.half_track_m)
    base, index = follower.parameters.copy(), [follower.index(name) for name in COEFFICIENTS]

    def simulate(values):
        base[index] = values
        return follower.run(len(measured), base, inputs={"measured": measured})["correction"][_SETTLED:]

    none = np.zeros((len(measured) + 1 - _SETTLED, 2))
    weights = 1.0 / np.maximum(simulate(np.array(start)).std(axis=0), 1e-12)
    # Encoder chatter makes the cost rough: descend from the best place of a coarse grid around the guess.
    guesses = [np.array(start) * factors for factors in itertools.product(_GRID, repeat=2)]
    start = min(guesses, key=lambda values: float(((weights * simulate(values)) ** 2).sum()))
    return prediction_error(simulate, dict(zip(("coulomb", "viscous"), start, strict=True)), none, weights, True, 1e-3)


def friction_estimates(problem: Problem, simulate=None, every: int = 1) -> dict[str, Estimate]:
    """Every regression method on Table 4.1's problem: method -> estimate."""
    return {
        "arx": arx(problem), "armax": armax(problem, every=every),
        "armaxd": armaxd(problem, CUT_OFF_HZ, every=every),
        "iv": instrumental(problem, simulate=simulate),
    }
