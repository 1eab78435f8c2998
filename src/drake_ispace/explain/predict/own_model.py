"""A user's own plant under `explain`: any Block of his that takes a torque per wheel and gives the wheels' angles.

    model = OwnModel(MyPlant(), torque="force", wheel_angle="position", wheel_rate="speed")
    print(di.explain(model, runs, effects=[*di.effects().values(), MyEffect()]))

"Torque" and "wheel" are what the library calls them: a force on a carriage or a voltage of a motor does as well, in
units of its own, as long as the recordings use the same. The wheels' effects that are nothing special to a robot
(`general = True`) apply, and whatever effects the user adds; the plant itself is left alone. There is no room and no
IMU: what is compared is the `encoder`, driven by the recorded `torque`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.systems.primitives import FirstOrderTaylorApproximation
from scipy.linalg import solve_continuous_are

from drake_ispace.blocks.block import Block
from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import Body, Effect
from drake_ispace.effects.library import library
from drake_ispace.explain.predict.filters import BANDWIDTH_RAD_S, CORRELATION_S, OTHER_NOISE
from drake_ispace.explain.predict.follower import Filter, Follower, design
from drake_ispace.explain.predict.replay import Replay, Values
from drake_ispace.explain.predict.room_view import LEAD_TICKS
from drake_ispace.explain.predict.tracks import Track, track
from drake_ispace.files.recording import Recording
from drake_ispace.plants.actuator import Actuator, TorqueActuator
from drake_ispace.plants.friction import Friction, stable_slope
from drake_ispace.robots.robot import Robot
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.effects import splice_effects

_UNKNOWN_SHARE = 0.05  # of the usual torque, assumed of forces that nobody knows
_LEAST_STEP_RAD = 1e-9  # between two angles, below which they are the same


@dataclass(frozen=True)
class OwnGeometry:
    """Stands in for a robot's wheels: "forward" is their mean. forward (3, n), inverse (n, 3)."""

    forward: np.ndarray
    inverse: np.ndarray
    sideways: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))


@dataclass(frozen=True)
class OwnPlant:
    """What effects may know of the plant. mobility (n, n): acceleration of the wheels per torque [rad/s^2 per N m]."""

    geometry: OwnGeometry
    mobility: np.ndarray


class OwnRobot(Robot):
    """A plant of which nobody here knows more than that a torque accelerates its wheels, in units of its own."""

    ground = None
    in_room = False
    in_si = False

    def __init__(self, name: str):
        self.name = name

    def plant_block(self, settings, plant, start=(0.0, 0.0, 0.0), seed=0, ground=False):
        return Block(plant.spec)

    def block_parameters(self, plant):
        return {}

    def mass_matrix(self, plant):
        return np.eye(3)

    def mobility(self, plant):
        return plant.mobility

    def friction(self, plant):
        return Friction()

    def least_friction(self, plant, name):
        """Any: how much of it the plant has is not known."""
        return -np.inf

    def friction_slopes(self, plant):
        most = stable_slope(max(float(np.abs(np.linalg.eigvals(plant.mobility)).max()), 1e-300))
        return most, most

    def force_of_command(self, plant):
        return np.ones(3)


@dataclass(frozen=True)
class OwnModel:
    """A user's plant, and how its ports are called.

    Attributes:
        plant: a Block; its continuous state at t = 0 is that of its Context, but for the wheels' angles, which are
            those of the run. torque: input (n,). wheel_angle, wheel_rate: outputs (n,) [rad, rad/s].
        name: prefix of the blocks. effects: name -> values of those that the model has already.
        unknown_torque: root mean square of forces that nobody knows [N m], None: 5 % of the recorded ones.
        logged: "angle", or "speed" where the runs' wheel angles are sums of a logged speed: what free-run simulations
            are compared in. free: parameters of the plant that no data sheet gives; free-run simulations fit them
            together with the effects, filters take them as the plant has them.

    Raises:
        InputError: logged is neither of both, or a free parameter is none of the plant's or zero.
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
        """Name -> value of the plant's own."""
        spec = self.plant.spec
        return dict(zip(spec.parameter_names, map(float, spec.parameter_values), strict=True))

    @property
    def wheels(self) -> int:
        return self.plant.GetInputPort(self.torque).size()

    def linearised(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(A (m, m), B (m, n), C (n, m)) from torque to wheel angle around the state of the default Context.

        Raises:
            InputError: no continuous state, or wheels that a torque does not accelerate at once.
        """
        context = self.plant.CreateDefaultContext()
        if not context.num_continuous_states():
            raise InputError(f"{self.name}: the plant has no continuous state, expected a Block with derivatives")
        self.plant.GetInputPort(self.torque).FixValue(context, np.zeros(self.wheels))
        found = FirstOrderTaylorApproximation(
            self.plant, context, self.plant.GetInputPort(self.torque).get_index(),
            self.plant.GetOutputPort(self.wheel_angle).get_index(),
        )
        a, b, c = found.A(), found.B(), found.C()
        at_once = np.abs(c @ b).max() > 1e-9 * np.abs(b).max()  # an angle that a torque moves without accelerating it
        if at_once or np.linalg.matrix_rank(c @ a @ b) < self.wheels:
            raise InputError(
                f"{self.name}: {self.torque} does not accelerate every wheel of {self.wheel_angle} at once, expected a "
                "plant that is driven by torque (a lag of the motor is an effect)"
            )
        return a, b, c


class _NamedBench(Bench):
    """A Bench on which ports of the plant answer to other names: "own_plant.torque" -> "own_plant.force"."""

    def __init__(self, others: Mapping[str, str]):
        super().__init__()
        self._others = dict(others)

    def _output(self, port):
        return super()._output(self._others.get(port, port))

    def _input(self, port):
        return super()._input(self._others.get(port, port))


@dataclass(frozen=True)
class OwnReplay(Replay):
    """The compiled prediction Diagram of a user's plant.

    Attributes:
        place: (m, n) continuous state per wheel angle. angles: (n,) of the plant's own start [rad].
        logged: as of the OwnModel. free: its free parameters and the plant's values of them.
    """

    place: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    angles: np.ndarray = field(default_factory=lambda: np.empty(0))
    logged: str = "angle"
    free: Mapping[str, float] = field(default_factory=dict)

    def run(self, run: Track, start: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """((ticks, n) innovations of the angles, (0, 3) for the room that there is not); start: as Replay."""
        return self._logs(run, start[3:], numbers)["innovation"][1 : run.ticks + 1], np.empty((0, 3))

    def pushed(self, run: Track, force: np.ndarray) -> Track:
        """The run with the first column of `force` (rows, 3) on every wheel besides."""
        return replace(run, command=run.command + force[:, :1])

    def simulated(self, run: Track, values: Values, plant: Mapping[str, float] | None = None) -> np.ndarray:
        """(ticks + 1, n) wheel angles [rad] with the recorded torque replayed open loop: nothing corrects the model.

        plant: other values of the plant's own parameters.
        """
        numbers = self.parameters(values)
        self._set(numbers, f"{self.body.name}_plant", plant or {})
        size = self.body.wheels
        for name, length in (("gain", len(self.place) * size), ("feedback", size * len(self.place))):
            self._set(numbers, f"{self.body.name}_follower", {name: np.zeros(length)})
        return self._logs(run, run.measured[0], numbers)["angle"][: run.ticks + 1]

    def _logs(self, run, angles, numbers):
        state = self.rollout.continuous_state + self.place @ (angles - self.angles)
        inputs = {"command": run.command, "measured": run.measured}
        return self.rollout.run(run.ticks + LEAD_TICKS, numbers, state, inputs=inputs)


def own_track(recording: Recording, model: OwnModel, name: str) -> Track:
    """The run on 5 ms ticks; torque logged faster than that as its mean over each tick.

    Raises:
        InputError: no torque or encoder, or one with another number of columns than the plant.
    """
    for channel in ("torque", "encoder"):
        if channel not in recording.channels:
            raise InputError(f"{name}: has no channel {channel}, expected torque and encoder")
    kept = {channel: recording.channels[channel] for channel in ("torque", "encoder")}
    found = track(replace(recording, channels=kept), OwnRobot(model.name), model.wheels, name)
    return replace(found, command=_means(recording.channels["torque"], found.command))


def _means(channel, held):
    """(rows, n) mean of what acts on each tick where the channel is faster than ticks, else `held`."""
    period = float(np.median(np.diff(channel.t)))
    if period > 0.75 * TICK_S:
        return held
    edges = np.arange(len(held) + 1) * TICK_S
    steps = np.append(np.diff(channel.t), period)
    sums = np.vstack([np.zeros(channel.values.shape[1]), np.cumsum(channel.values * steps[:, None], axis=0)])
    t = np.append(channel.t, channel.t[-1] + period)
    inner = np.column_stack([np.interp(edges, t, column) for column in sums.T])
    return np.diff(inner, axis=0) / TICK_S


def own_replay(model: OwnModel, tracks: Sequence[Track], effects: Sequence[Effect] | None = None) -> OwnReplay:
    """Build and compile for these runs. effects: to try, default the whole library.

    Raises:
        InputError: a plant that cannot be followed (OwnModel.linearised), or a known effect that is not given.
    """
    a, b, c = model.linearised()
    n = model.wheels
    mean = np.zeros((3, n))
    mean[0] = 1.0 / n
    geometry = OwnGeometry(mean, np.linalg.pinv(mean))
    body = Body(OwnRobot(model.name), OwnPlant(geometry, c @ a @ b), n)
    every = {
        e.card.name: e for e in (library().values() if effects is None else effects)
        if e.applies_to(body)
    }
    if missing := set(model.effects) - set(every):
        raise InputError(f"{model.name}: the known effect {missing.pop()} is not among those given")
    assumed = ((1.0, 1.0), (OTHER_NOISE, 1.0), (1.0, OTHER_NOISE))
    filters = [_filter(model, tracks, factors, (a, b, c)) for factors in assumed]
    rollout = compile_diagram(_diagram(model, body, every, filters[0]))
    context = model.plant.CreateDefaultContext()
    model.plant.GetInputPort(model.torque).FixValue(context, np.zeros(n))
    angles = model.plant.GetOutputPort(model.wheel_angle).Eval(context)
    known = {name: dict(values) for name, values in model.effects.items()}
    return OwnReplay(
        body, every, known, rollout, frozenset({"torque", "encoder"}), filters[1:], place=np.linalg.pinv(c),
        angles=angles, logged=model.logged, free={name: model.parameters[name] for name in model.free},
    )


def _diagram(model: OwnModel, body: Body, effects: Mapping[str, Effect], filter: Filter):
    plant, follower, command = (f"{body.name}_{part}" for part in ("plant", "follower", "command"))
    bench = _NamedBench({
        f"{plant}.{common}": f"{plant}.{own}" for common, own in
        (("torque", model.torque), ("wheel_angle", model.wheel_angle), ("wheel_rate", model.wheel_rate))
    })
    bench.add(plant, Block(model.plant.spec))
    bench.add(command, TorqueActuator(Actuator(), body.wheels))
    bench.add(follower, Follower(filter))
    bench.wire(
        (f"{command}.torque", f"{follower}.push"), (f"{follower}.push", f"{plant}.torque"),
        (f"{plant}.wheel_angle", f"{follower}.modelled"),
    )
    neutral = [(effect, effect.neutral(body)) for effect in effects.values() if effect.replayed]
    splice_effects(bench, body, neutral, {"torque": [f"{follower}.push"], "wheel_angle": [f"{follower}.modelled"]})
    bench.let_in(command=f"{command}.command", measured=f"{follower}.measured")
    bench.show(innovation=f"{follower}.innovation", angle=f"{plant}.wheel_angle")
    return bench.build(f"{body.name}_replay")


def _filter(model, tracks, factors, linear) -> Filter:
    """The follower's filter; factors: times the spectral density of unknown torques and the encoder's variance."""
    a, b, c = linear
    n = model.wheels
    torque = np.sqrt(np.mean(np.vstack([t.command[: t.ticks] for t in tracks]) ** 2)) or 1.0
    rms = _UNKNOWN_SHARE * torque if model.unknown_torque is None else model.unknown_torque
    process = b @ (2.0 * rms**2 * CORRELATION_S * factors[0] * np.eye(n)) @ b.T
    sensors = np.full(n, _angle_variance(tracks) * factors[1])
    mobility = c @ a @ b
    effort = mobility.T @ mobility / BANDWIDTH_RAD_S**4
    value = solve_continuous_are(a, b, c.T @ c + 1e-12 * np.eye(len(a)), effort)
    feedback = np.linalg.solve(effort, b.T @ value)
    return design(a, b, c, np.zeros((n, n)), process, sensors, feedback, np.eye(n))


def _angle_variance(tracks):
    """Of one sample of the encoder [rad^2]: a count's rounding, or noise as large as it shows from tick to tick."""
    steps = np.abs(np.vstack([np.diff(t.measured[: t.ticks], axis=0) for t in tracks]))
    count = float(np.min(steps, where=steps > _LEAST_STEP_RAD, initial=1.0))
    bends = np.vstack([np.diff(t.measured[: t.ticks], n=3, axis=0) for t in tracks])
    noise = np.median(np.abs(bends)) ** 2 / 20.0 / 0.455  # of a third difference: 20 times a sample's, median 0.455
    return max(count**2 / 12.0, float(noise), 1e-16)
