"""A user's own plant under `explain`: any Block that takes a torque per wheel and gives the wheels' angles.

    model = OwnModel(MyPlant(), torque="force", wheel_angle="position", wheel_rate="speed")
    print(di.explain(model, runs, effects=[*di.effects().values(), MyEffect()]))

"Torque" and "wheel" are the library's names. The force on a carriage or the voltage of a motor will do, in units of its
own, as long as the recordings use the same. Effects of wheels that suit any robot (`general = True`) apply, and effects
that the user adds; none changes a parameter of the plant. There is no room and no IMU: the recorded `torque` drives the
model, and the `encoder` is compared.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from pydrake.systems.primitives import FirstOrderTaylorApproximation

from drake_ispace.blocks.block import Block
from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.plants.friction import Friction, stable_slope
from drake_ispace.robots.robot import Robot
from drake_ispace.sensing.encoder import Encoder

_SPEEDS_RAD_S = np.geomspace(1e-3, 1e3)  # at which friction is looked for


@dataclass(frozen=True)
class OwnGeometry:
    """Stands in for the geometry of a robot's wheels: "forward" (3, n) is their mean."""

    forward: np.ndarray
    holds_turns: ClassVar[bool] = False

    @property
    def wheels(self) -> range:
        """Their numbers."""
        return range(self.forward.shape[1])


@dataclass(frozen=True)
class OwnPlant:
    """The plant, as far as effects may know it.

    mobility (n, n): acceleration of the wheels per torque [rad/s^2 per N m]. friction: largest viscous and Coulomb
    friction that brakes a wheel, by the names of `plants.friction`; empty: not known. load: a function of wheel angles
    (k, n) [rad] and rates (k, n) [rad/s], that gives the torques (k, n) [N m] by which the plant turns its wheels
    itself, such as its weight's; None: its state is more than these.
    """

    geometry: OwnGeometry
    mobility: np.ndarray
    friction: Mapping[str, float] = field(default_factory=dict)
    load: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True)
class OwnSettings:
    """What else a scenario would say of a robot: plant, and an encoder whose counts are not known."""

    plant: OwnPlant
    encoder: Encoder = field(default_factory=lambda: Encoder(counts_per_turn=0))


class OwnRobot(Robot):
    """A plant of which one thing is known: torque accelerates its wheels. Units are its own.

    wheels: the number n of them.
    """

    ground = None
    in_room = False
    in_si = False

    def __init__(self, name: str, wheels: int):
        self.name = name
        self.wheels = wheels

    def plant_block(self, settings, plant, start=(0.0, 0.0, 0.0), seed=0, ground=False):
        return Block(plant.spec)

    def wheel_count(self, plant):
        return self.wheels

    def by_wheel(self, channel, plant, where):
        """Its columns have names of their own."""
        if len(channel.columns) != self.wheels:
            raise InputError(f"{where} has {len(channel.columns)} columns, expected {self.wheels}")
        return channel

    def block_parameters(self, plant):
        return {}

    @property
    def unweighted(self):
        """Every wheel is a coordinate of its own."""
        return list(range(self.wheels))

    def mass_matrix(self, plant):
        """(n, n) torque per acceleration of the wheels."""
        return np.linalg.inv(plant.mobility)

    def effort(self, plant):
        return np.eye(self.wheels)

    def rates(self, plant, wheel_rates, lean_rate):
        return wheel_rates

    def turning(self, rates):
        return np.zeros_like(rates)

    def friction(self, plant):
        return Friction()

    def least_friction(self, plant, name):
        """An effect may take away what friction the plant has, and no more; where that is not known, any."""
        return -plant.friction.get(name, np.inf)

    def friction_slopes(self, plant):
        most = stable_slope(max(float(np.abs(np.linalg.eigvals(plant.mobility)).max()), 1e-300))
        return most, most

    def force_of_command(self, plant):
        return np.ones(3)


@dataclass(frozen=True)
class OwnModel:
    """A user's plant, and the names of its ports.

    Attributes:
        plant: a Block. At t = 0 its continuous state is that of its default Context, but for the wheels' angles, which
            are those of the run.
        torque: the input (n,). wheel_angle, wheel_rate: the outputs (n,) [rad, rad/s].
        name: prefix of the blocks.
        effects: name -> values of the effects that the model has already.
        unknown_torque: root mean square of unknown torques [N m]; None: 5 % of that of the recorded torque.
        logged: what free-run simulations are compared in, "angle", or "speed" where the runs' wheel angles are sums of
            a logged speed.
        free: parameters of the plant that no data sheet gives. Free-run simulations fit them together with the
            effects; the filter takes their values from the plant.

    Raises:
        InputError: `logged` is neither "angle" nor "speed", or a free parameter is zero or not one of the plant's.
    """

    plant: Block
    torque: str = "torque"
    wheel_angle: str = "wheel_angle"
    wheel_rate: str = "wheel_rate"
    name: str = "own"
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    unknown_torque: float | None = None
    logged: str = "angle"
    free: Sequence[str] = ()

    def __post_init__(self):
        if self.logged not in ("angle", "speed"):
            raise InputError(f"{self.name}: logged is {shown(self.logged)}, expected 'angle' or 'speed'")
        values = self.parameters
        for name in self.free:
            if name not in values:
                known = expected_one_of(name, values)
                raise InputError(f"{self.name}: the plant has no parameter {shown(name)}, {known}")
            if values[name] == 0.0:
                raise InputError(f"{self.name}: the free parameter {name} is 0, expected the value to begin with")

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value of the plant's parameters."""
        spec = self.plant.spec
        return dict(zip(spec.parameter_names, map(float, spec.parameter_values), strict=True))

    @property
    def wheels(self) -> int:
        """The number n of wheels."""
        return self.plant.GetInputPort(self.torque).size()

    def linearised(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(A (m, m), B (m, n), C (n, m)) from torque to wheel angle, around the state of the default Context.

        Raises:
            InputError: the plant has no continuous state, or a torque does not accelerate every wheel at once.
        """
        context = self.plant.CreateDefaultContext()
        if not context.num_continuous_states():
            raise InputError(f"{self.name}: the plant has no continuous state, expected a Block with derivatives")
        self.plant.GetInputPort(self.torque).FixValue(context, np.zeros(self.wheels))
        linear = FirstOrderTaylorApproximation(
            self.plant, context, self.plant.GetInputPort(self.torque).get_index(),
            self.plant.GetOutputPort(self.wheel_angle).get_index(),
        )
        a, b, c = linear.A(), linear.B(), linear.C()
        moves_at_once = np.abs(c @ b).max() > 1e-9 * np.abs(b).max()  # torque sets the rate of an angle
        if moves_at_once or np.linalg.matrix_rank(c @ a @ b) < self.wheels:
            raise InputError(
                f"{self.name}: {self.torque} does not accelerate every wheel of {self.wheel_angle} at once, expected a "
                "plant that is driven by torque (a lag of the motor is an effect)"
            )
        return a, b, c

    def in_motion(self, speeds: np.ndarray) -> np.ndarray:
        """(m, m) A of `linearised` for wheels that turn to and fro at `speeds` (n,) [rad/s].

        Dry friction is steep about rest and level elsewhere: a filter that takes it for as steep everywhere does not
        hold a model that moves.
        """
        a, b, c = self.linearised()
        kicks, change, changes = _kicks(a, b, c), self._change(), []
        for kick, speed in zip(kicks.T, speeds, strict=True):
            changes.append(change(speed * kick) / speed if speed > 0.0 else a @ kick)
        steeper = np.column_stack(changes) - a @ kicks
        return a + steeper @ c @ a if np.isfinite(steeper).all() else a

    def _change(self) -> Callable[[np.ndarray], np.ndarray]:
        """A function of a change (m,) of the default state: (m,) half the difference of the derivatives there and at
        the opposite change."""
        _, start, derivatives = self._without_torque()
        return lambda kick: 0.5 * (derivatives(start + kick) - derivatives(start - kick))

    def _without_torque(self):
        """A default Context without torque, its state (m,), and a function of a state (m,): its derivatives (m,)."""
        context = self.plant.CreateDefaultContext()
        self.plant.GetInputPort(self.torque).FixValue(context, np.zeros(self.wheels))
        start = context.get_continuous_state_vector().CopyToVector()

        def derivatives(state):
            context.SetContinuousState(state)
            return self.plant.EvalTimeDerivatives(context).CopyToVector()

        return context, start, derivatives

    @property
    def robot(self) -> OwnRobot:
        """The plant as a robot."""
        return OwnRobot(self.name, self.wheels)

    @cached_property
    def settings(self) -> OwnSettings:
        """What is known of the robot; raises as `linearised` does."""
        a, b, c = self.linearised()
        mean = np.zeros((3, self.wheels))
        mean[0] = 1.0 / self.wheels
        return OwnSettings(OwnPlant(OwnGeometry(mean), c @ a @ b, self._friction(a, b, c), self._load(a, b, c)))

    def _load(self, a, b, c) -> Callable[[np.ndarray, np.ndarray], np.ndarray] | None:
        """The `load` of OwnPlant."""
        if len(a) != 2 * self.wheels:
            return None
        state_of, torque_of = np.linalg.inv(np.vstack([c, c @ a])), np.linalg.solve(c @ a @ b, c @ a)

        def load(angles, rates):
            context, start, derivatives = self._without_torque()
            turned = [self.plant.GetOutputPort(name).Eval(context) for name in (self.wheel_angle, self.wheel_rate)]
            motions = np.hstack([angles, rates]) - np.concatenate(turned)
            return np.array([torque_of @ derivatives(start + state_of @ motion) for motion in motions])

        return load

    def _friction(self, a, b, c) -> dict[str, float]:
        """Friction that brakes every wheel: viscous at all speeds, Coulomb beyond what grows with speed.

        Empty where a torque drives its own wheel backward, or the plant gives no numbers at some speed.
        """
        mobility, torques, change = c @ a @ b, [], self._change()
        for kick in _kicks(a, b, c).T:
            for speed in _SPEEDS_RAD_S:
                torques.append(-np.linalg.solve(mobility, c @ a @ change(speed * kick)))
        braking = np.reshape(torques, (self.wheels, len(_SPEEDS_RAD_S), self.wheels))
        braking = np.einsum("isi->is", braking)  # (n, speeds) of each wheel by its own speed
        if not np.isfinite(braking).all() or np.diag(mobility).min() <= 0.0:
            return {}
        dry = braking - np.outer(braking[:, -1] / _SPEEDS_RAD_S[-1], _SPEEDS_RAD_S)
        return {
            "viscous_n_m_s": max(float((braking / _SPEEDS_RAD_S).min()), 0.0),
            "coulomb_n_m": max(float(dry.max(axis=1).min()), 0.0),
        }


def _kicks(a, b, c) -> np.ndarray:
    """(m, n) changes of the state that turn one wheel by 1 rad/s."""
    return b @ np.linalg.inv(c @ a @ b)
