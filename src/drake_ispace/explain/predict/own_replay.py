"""The prediction Diagram of a user's own plant (OwnModel), and its runs on ticks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_continuous_are
from scipy.signal import lfilter

from drake_ispace.blocks.block import Block
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import Body, Effect
from drake_ispace.explain.counts import smallest_step
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.filters import BANDWIDTH_RAD_S, CORRELATION_S, OTHER_NOISE
from drake_ispace.explain.predict.follower import Filter, Follower, design
from drake_ispace.explain.predict.prediction import wheel_speeds
from drake_ispace.explain.predict.replay import Replay, Values, applicable
from drake_ispace.explain.predict.room_view import LEAD_TICKS
from drake_ispace.explain.predict.tracks import Track, read_ticks, track
from drake_ispace.files.recording import Recording
from drake_ispace.plants.actuator import Actuator, TorqueActuator
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.effects import splice_effects

_UNKNOWN_SHARE = 0.05  # unknown forces, assumed: of the root mean square of the recorded torque


class _NamedBench(Bench):
    """A Bench on which ports have further names, such as "own_plant.torque" -> "own_plant.force"."""

    def __init__(self, names: Mapping[str, str]):
        super().__init__()
        self._names = dict(names)

    def _output(self, port):
        return super()._output(self._names.get(port, port))

    def _input(self, port):
        return super()._input(self._names.get(port, port))


@dataclass(frozen=True)
class OwnReplay(Replay):
    """The compiled prediction Diagram of a user's plant.

    Attributes:
        place, motion: (m, n) continuous state per wheel angle, and per rate of a wheel.
        angles: (n,) wheel angles of the plant's default Context [rad].
        logged: "angle" or "speed", see OwnModel.
        free: name -> the plant's value of each free parameter.
        unknown_torque: root mean square of unknown torques [N m], assumed. angle_std: standard deviation of an encoder
            sample [rad].
    """

    place: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    motion: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    angles: np.ndarray = field(default_factory=lambda: np.empty(0))
    logged: str = "angle"
    free: Mapping[str, float] = field(default_factory=dict)
    unknown_torque: float = 0.0
    angle_std: float = 0.0

    may_begin_late = False

    def run(self, run: Track, start: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(ticks, n) innovations of the angles, and (0, 3) for a room: there is none.

        start: (3 + n,) a pose, which is ignored, and wheel angles at t = 0. numbers: the rollout's run-time numbers.
        """
        return self._logs(run, start[3:], numbers)["innovation"][1 : run.ticks + 1], np.empty((0, 3))

    def pushed(self, run: Track, force: np.ndarray) -> Track:
        """The run with the first column of `force` (rows, 3) added to the torque of every wheel."""
        return replace(run, command=run.command + force[:, :1])

    def disturbed(self, run: Track, seed: list[int]) -> Track:
        """The run with a draw of unknown torques, as strong as the model assumes, on every wheel."""
        keep = np.exp(-TICK_S / CORRELATION_S)
        white = np.random.default_rng(seed).standard_normal(run.command.shape)
        torque = self.unknown_torque * lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white, axis=0)
        if not run.unscored_ticks:  # a run that begins at rest begins with the first torque
            torque[: int(np.argmax(np.any(run.command != 0.0, axis=1)))] = 0.0
        return replace(run, command=run.command + torque)

    def simulated(
        self, run: Track, values: Values, plant: Mapping[str, float] | None = None, start: np.ndarray | None = None
    ) -> np.ndarray:
        """(ticks + 1, n) angles [rad] that the encoders show of a free-run simulation: recorded torque, no correction.

        values: effects in the model. plant: other values of the plant's parameters. start: (2 n,) wheel angles [rad]
        and their rates [rad/s] at t = 0; None: at rest at the first measured angles.
        """
        numbers = self.parameters(values)
        self._set(numbers, f"{self.body.name}_plant", plant or {})
        angles, rates = (run.measured[0], None) if start is None else np.split(start, 2)
        return self._logs(run, angles, self.freed(numbers), rates)["angle"][: run.ticks + 1]

    def _logs(self, run, angles, numbers, rates=None):
        """Logs of the rollout from these wheel angles (n,) [rad] and rates (n,) [rad/s] at t = 0; None: at rest."""
        state = self.rollout.continuous_state + self.place @ (angles / self._shown_per_turned(numbers) - self.angles)
        if rates is not None:
            state = state + self.motion @ rates
        inputs = {"command": run.command, "measured": run.shown}
        return self.rollout.run(run.ticks + LEAD_TICKS, self.since(run, numbers), state, inputs=inputs)


def own_track(recording: Recording, model: OwnModel, name: str) -> Track:
    """Put a recording of the plant on 5 ms ticks; torque, held from sample to sample, is averaged over each tick.

    Raises:
        InputError: no channel torque or encoder, or one with another number of columns than the plant has wheels.
    """
    for channel in ("torque", "encoder"):
        if channel not in recording.channels:
            raise InputError(f"{name}: has no channel {channel}, expected torque and encoder")
    kept = {channel: recording.channels[channel] for channel in ("torque", "encoder")}
    return track(replace(recording, channels=kept), model.robot, model, name, shortest_s=0.0)


def own_replay(
    model: OwnModel, tracks: Sequence[Track], effects: Sequence[Effect] | None = None, others: Sequence[Track] = (),
) -> OwnReplay:
    """Build and compile the prediction Diagram of a user's plant.

    Args:
        tracks: runs that the filter's assumptions about noise are taken from.
        effects: to try, default the whole library.
        others: further runs that the filter is to follow, however rarely their encoders were read.

    Raises:
        InputError: a plant that cannot be followed (OwnModel.linearised), or an effect of the model that is not among
            `effects`.
    """
    a, b, c = model.linearised()
    n = model.wheels
    body = Body(model.robot, model.settings.plant, n)
    every = applicable(effects, body)
    if missing := set(model.effects) - set(every):
        raise InputError(f"{model.name}: the known effect {min(missing)} is not among those given")
    assumed = ((1.0, 1.0), (OTHER_NOISE, 1.0), (1.0, OTHER_NOISE))
    moving = model.in_motion(_usual_speeds(tracks, n)), b, c
    ticks = read_ticks([*tracks, *others])
    filters = [_filter(model, tracks, factors, moving, ticks) for factors in assumed]
    filter = lambda plant, changed=None: filters[0 if changed is None else 1 + changed]  # noqa: E731
    rollout = compile_diagram(_diagram(model, body, every, filters[0]))
    context = model.plant.CreateDefaultContext()
    model.plant.GetInputPort(model.torque).FixValue(context, np.zeros(n))
    angles = model.plant.GetOutputPort(model.wheel_angle).Eval(context)
    known = {name: dict(values) for name, values in model.effects.items()}
    return OwnReplay(
        body, every, known, rollout, frozenset({"torque", "encoder"}), filter, len(filters) - 1,
        settling_ticks=filters[0].settling_ticks, place=np.linalg.pinv(c),
        motion=np.linalg.pinv(np.vstack([c, c @ a]))[:, n:], angles=angles, logged=model.logged,
        free={name: model.parameters[name] for name in model.free},
        unknown_torque=_unknown_torque(model, tracks), angle_std=float(np.sqrt(_angle_variance(tracks))),
    )


def _diagram(model: OwnModel, body: Body, effects: Mapping[str, Effect], filter: Filter):
    """The prediction Diagram: command and measured in, innovation and angle out."""
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
    bench.show(innovation=f"{follower}.innovation", angle=bench.source(f"{follower}.modelled"))
    return bench.build(f"{body.name}_replay")


def _filter(model, tracks, factors, linear, ticks) -> Filter:
    """The follower's filter; factors: on the spectral density of unknown torques, and on the encoder's variance.

    ticks: from one read of the encoders to the next.
    """
    a, b, c = linear
    n = model.wheels
    process = b @ (2.0 * _unknown_torque(model, tracks) ** 2 * CORRELATION_S * factors[0] * np.eye(n)) @ b.T
    sensors = np.full(n, _angle_variance(tracks) * factors[1])
    mobility = c @ a @ b
    effort = mobility.T @ mobility / BANDWIDTH_RAD_S**4
    value = solve_continuous_are(a, b, c.T @ c + 1e-12 * np.eye(len(a)), effort)
    feedback = np.linalg.solve(effort, b.T @ value)
    return design(a, b, c, np.zeros((n, n)), process, sensors, feedback, np.eye(n), ticks)


def _usual_speeds(tracks, n) -> np.ndarray:
    """(n,) root mean square speed of each wheel [rad/s]."""
    speeds = np.vstack([wheel_speeds(track.measured[: track.ticks, :n]) for track in tracks])
    return np.sqrt(np.mean(speeds**2, axis=0))


def _unknown_torque(model, tracks) -> float:
    """Root mean square of unknown torques [N m]."""
    if model.unknown_torque is not None:
        return model.unknown_torque
    return _UNKNOWN_SHARE * float(np.sqrt(np.mean(np.vstack([t.command[: t.ticks] for t in tracks]) ** 2)) or 1.0)


def _angle_variance(tracks):
    """Variance of one encoder sample [rad^2]: a count's rounding, or the noise from read to read if that is larger."""
    read = [t.measured[: t.ticks] if t.reads is None else t.measured[t.reads[t.reads < t.ticks]] for t in tracks]
    count = min(smallest_step(angles, 1.0) for angles in read)
    thirds = np.vstack([np.diff(angles, n=3, axis=0) for angles in read])
    # a third difference has 20 times a sample's variance; the median of a squared normal deviate is 0.455 variances
    noise = np.median(np.abs(thirds)) ** 2 / 20.0 / 0.455
    return max(count**2 / 12.0, float(noise), 1e-16)
