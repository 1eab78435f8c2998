"""The prediction Diagram: the robot's model on recorded commands, held on the measured motion, under the room's camera.

It contains every effect of the library at its neutral value. Any set of effects, at any size, is tried by changing
run-time numbers of one compiled rollout.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import Multiplexer

from drake_ispace.blocks.block import Spec
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import BlockEffect, Body, Effect, PlantEffect, body_of
from drake_ispace.effects.library import library
from drake_ispace.effects.wires import VelocityEffect, WheelAngleEffect
from drake_ispace.explain.levels import BLOCK_TICKS
from drake_ispace.explain.predict.filters import ASSUMED, filters_of
from drake_ispace.explain.predict.follower import Filter, Follower, numbers_of
from drake_ispace.explain.predict.room_view import LEAD_TICKS, RoomView
from drake_ispace.explain.predict.tracks import IMU, Track
from drake_ispace.plants.actuator import Actuator, TorqueActuator
from drake_ispace.robots.robot import COMMAND, TORQUE, Robot
from drake_ispace.rollout.compile import Rollout, compile_diagram
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.bench import Bench, Part
from drake_ispace.wiring.effects import chosen_effects, splice_effects

Values = Mapping[str, Mapping[str, float]]  # effect -> parameter -> value
Inputs = Callable[[Track, np.ndarray], dict[str, np.ndarray]]  # (run, run-time numbers) -> inputs of the rollout
_WHOLE = 2.0  # tanh(2) = 0.96
_LED = 16  # innovations of the fixes of a run, under other run-time numbers each, that are kept


@dataclass(frozen=True)
class Replay:
    """A compiled prediction Diagram.

    Attributes:
        body: what effects may know of the robot.
        effects: name -> effect, of all that can be tried.
        known: name -> values of the effects that the model has already.
        rollout: the compiled Diagram.
        feeds: the channels that every run has, and the camera's if any run has it: it holds no model on the motion.
        filter: plant -> the follower's filter; with a number besides, that under another assumption about noise.
        others: how many of these there are.
        settling_ticks: of the filter, where a run begins while the robot moves; where velocity is commanded, how long
            its drive may still follow what was commanded before.
        alone: indices of run-time numbers, and their values, with which wheels alone move the model, whatever was
            commanded; None: no velocity was recorded.
        motion: whether innovations of the outputs are wanted where a rollout of their own gives them; else they are
            (ticks, 0).
    """

    body: Body
    effects: dict[str, Effect]
    known: dict[str, dict[str, float]]
    rollout: Rollout
    feeds: frozenset[str]
    filter: Callable[..., Filter]
    others: int
    settling_ticks: int = 0
    alone: tuple[np.ndarray, np.ndarray] | None = None
    motion: bool = True
    _packed: WeakKeyDictionary = field(default_factory=WeakKeyDictionary, repr=False)
    _led: WeakKeyDictionary = field(default_factory=WeakKeyDictionary, repr=False)

    @property
    def may_begin_late(self) -> bool:
        """Whether one rollout gives all, and its inputs at a tick are what was recorded until then."""
        return self.body.robot.driven == TORQUE

    def combined(self, values: Values) -> dict[str, dict[str, float]]:
        """Values of these effects and of the known ones; those of a known effect are added to what the model has."""
        together = {name: dict(v) for name, v in self.known.items()}
        for name, changed in values.items():
            known = together.setdefault(name, {})
            neutral = self.effects[name].neutral(self.body)
            for key, value in changed.items():
                known[key] = value + known[key] - neutral[key] if key in known else value
        return together

    def parameters(self, values: Values, other: int | None = None) -> np.ndarray:
        """The rollout's run-time numbers with these effects in it, besides the known ones.

        other: number of the assumption about noise under which the filter is another; None: none is.
        """
        together = self.combined(values)
        numbers, plant = self.rollout.parameters.copy(), self.body.plant
        for name, effect in self.effects.items():
            if name not in together or not effect.replayed:
                continue
            full = effect.neutral(self.body) | together[name]
            if isinstance(effect, PlantEffect):
                plant = effect.change(self.body.robot, plant, full)
            if not isinstance(effect, BlockEffect):
                continue
            if effect.wire == "fix" and "offset_s" in full:
                self._set(numbers, f"{self.body.name}_view", {"offset_s": full["offset_s"]})
            else:
                self._set(numbers, f"{self.body.name}_{name}", effect.block_parameters(self.body, full))
        if plant is not self.body.plant:
            self._set(numbers, f"{self.body.name}_plant", self.body.robot.block_parameters(plant))
        if plant is not self.body.plant or other is not None:
            self._set(numbers, f"{self.body.name}_follower", numbers_of(self.filter(plant, other)))
        return numbers

    def turning_rad_s(self, values: Values) -> float:
        """The speed of a wheel [rad/s] above which the model with these effects has the dry friction of a turning one.

        The fixed step allows no jump with the sign of the speed. Friction grows over a width around standstill, more
        slowly than a robot's, and is nearly whole at _WHOLE widths.
        """
        numbers = dict(zip(self.rollout.parameter_names, self.parameters(values), strict=True))
        widths = [numbers.get(f"{self.body.name}_{name}.speed_scale_rad_s", 0.0) for name in self.combined(values)]
        own = self.body.robot.friction(self.body.plant)
        if own.coulomb_n_m > 0.0 and own.model == "smooth":
            widths.append(numbers[f"{self.body.name}_plant.friction.speed_scale"])
        return _WHOLE * max(widths, default=0.0)

    def pushed(self, run: Track, force: np.ndarray) -> Track:
        """The run with a further force (rows, 3) on the body, along the coordinates of the plant's input `ground_force`
        [N, N m]; where velocity is commanded, a further velocity along the axes of B [m/s, m/s, rad/s]."""
        if self.body.robot.driven == COMMAND:
            return dataclasses.replace(run, command=run.command + force)
        return dataclasses.replace(run, force=force)

    def run(self, run: Track, start: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(ticks, p) innovations of the outputs at every tick, and (k, 3) innovations of the fixes.

        Where velocity is commanded, the wheels alone lead to the fixes, whatever was commanded, and without rounding,
        which would change with the instant at which one looks.

        start: (3 + n,) pose and wheel angles at t = 0. numbers: the rollout's run-time numbers.
        """
        numbers = self.since(run, numbers)
        if self.alone is None:
            return self.shown(run, self._logs(run, start, numbers, self.logged_inputs))
        innovations = np.empty((run.ticks, 0))
        if self.motion:
            innovations = self.shown(run, self._logs(run, start, numbers, self.logged_inputs))[0]
        return innovations, self._led_by_wheels(run, start, numbers)

    def _led_by_wheels(self, run, start, numbers):
        """(k, 3) innovations of the fixes where wheels alone move the model: the same whatever lies before the wheels.

        The last ones are kept as long as the run is.
        """
        which, values = self.alone
        numbers = numbers.copy()
        numbers[which] = values
        kept, key = self._led.setdefault(run, {}), (start.tobytes(), numbers.tobytes())
        fixes = kept.pop(key, None)
        if fixes is None:
            fixes = self.shown(run, self._logs(run, start, numbers, self._straight_inputs))[1]
        for oldest in list(kept)[: len(kept) + 1 - _LED]:  # another thread may have been here
            kept.pop(oldest, None)
        kept[key] = fixes
        return fixes

    @staticmethod
    def shown(run: Track, logs: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """As `run`, from the logs of a rollout."""
        return logs["innovation"][1 : run.ticks + 1], logs["view"][run.fix_rows + 1]

    def _logs(self, run, start, numbers, inputs):
        return self.rollout.run(
            run.ticks + LEAD_TICKS, numbers, self.state(start, numbers), inputs=self.packed(run, numbers, inputs)
        )

    def packed(self, run: Track, numbers: np.ndarray, inputs: Inputs) -> np.ndarray:
        """The inputs of a run as the rollout takes them.

        The last ones of every kind are kept as long as the run is: only the encoders' scales among the run-time numbers
        change them.

        inputs: `inputs`, `logged_inputs` or another method of this kind.
        """
        kept, kind, scales = self._packed.setdefault(run, {}), inputs.__name__, numbers[self._scales].tobytes()
        known, packed = kept.get(kind, (None, None))  # at once: another thread may put others there
        if known != scales:
            packed = self.rollout.packed(run.ticks + LEAD_TICKS, inputs(run, numbers))
            kept[kind] = scales, packed
        return packed

    def logged_inputs(self, run: Track, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """As `inputs`, with what the encoders showed at the ticks at which they were read."""
        return self.inputs(run, numbers) | {"measured": run.shown}

    def _straight_inputs(self, run, numbers):
        """As `inputs`, as the wheels turned, without rounding."""
        return self.inputs(run, numbers) | {"measured": run.turned, "command": self._turned(run, numbers)}

    def since(self, run: Track, numbers: np.ndarray) -> np.ndarray:
        """The run-time numbers for a run that is a later part of a recording: some effects grow with time."""
        if run.since_s == 0.0:
            return numbers
        numbers = numbers.copy()
        numbers[[name.endswith(".since_s") for name in self.rollout.parameter_names]] = run.since_s
        return numbers

    def state(self, start: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """The rollout's continuous state at rest.

        start: (3 + n,) pose, and angles of the wheels as encoders show them: a counter may have begun long ago.
        numbers: the rollout's run-time numbers.
        """
        state = self.rollout.continuous_state.copy()
        state[:3] = start[:3]
        first = self.body.robot.first_wheel
        state[first : first + self.body.wheels] = start[3:] / self._shown_per_turned(numbers)
        return state

    def inputs(self, run: Track, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """The rollout's inputs: name -> (rows, size); numbers: its run-time numbers."""
        inputs = {"command": self._command(run, numbers), "measured": run.measured, "sighting": run.sightings}
        if self.body.robot.driven == TORQUE:
            inputs["force"] = np.zeros((len(run.command), 3)) if run.force is None else run.force
        return inputs

    def freed(self, numbers: np.ndarray) -> np.ndarray:
        """A copy of the run-time numbers with which nothing corrects the model: free-run simulation."""
        changed = numbers.copy()
        changed[self._corrections] = 0.0
        return changed

    @cached_property
    def _corrections(self):
        """Which of the run-time numbers correct the model."""
        return [
            i for i, name in enumerate(self.rollout.parameter_names)
            if name.startswith((f"{self.body.name}_follower.gain", f"{self.body.name}_follower.feedback"))
        ]

    def clock_offset_s(self, numbers: np.ndarray) -> float:
        """By how much the camera's clock is taken to be behind [s]."""
        return float(numbers[self.rollout.index(f"{self.body.name}_view.offset_s")])

    def _command(self, run, numbers):
        """(rows, m) the recorded command; the measured wheels' velocity where it was not recorded."""
        if self.body.robot.driven == TORQUE or COMMAND in self.feeds:
            return run.command
        return run.command + self._turned(run, numbers)

    @cached_property
    def _scales(self):
        """(k, wheels) which of the run-time numbers encoders multiply the angles of the wheels by."""
        scaling = [
            name for name, effect in self.effects.items()
            if isinstance(effect, WheelAngleEffect) and effect.scales and effect.replayed
        ]
        wheels = range(self.body.wheels)
        return np.array([
            [self.rollout.index(f"{self.body.name}_{name}.gain[{wheel}]") for wheel in wheels] for name in scaling
        ], dtype=int).reshape(-1, self.body.wheels)

    def _shown_per_turned(self, numbers):
        """(wheels,) by what encoders with these run-time numbers multiply the angles of the wheels."""
        return numbers[self._scales].prod(axis=0)

    def _turned(self, run, numbers):
        """(rows, 3) velocity in B, as the wheels turn of which the encoders show the angles, without rounding."""
        turned = np.diff(run.turned, axis=0, append=run.turned[-1:]) / self._shown_per_turned(numbers)
        return turned @ self._forward.T / TICK_S

    @cached_property
    def _forward(self):
        """(3, n) from the wheels' speeds to the velocity in B."""
        return self.body.plant.nominal_geometry.forward

    def ways(self, run: Track, numbers: np.ndarray) -> np.ndarray:
        """(rows, 3) the way [m, m, rad] along the axes of B since t = 0 of a robot that is driven by velocity.

        As its wheels turned, or as commanded where they were not recorded; numbers: the rollout's run-time numbers.
        """
        velocity = self._turned(run, numbers) if "encoder" in self.feeds else run.command
        return np.cumsum(velocity, axis=0) * TICK_S

    def _set(self, numbers, block, parameters):
        """Write these parameters of a block into run-time numbers."""
        spec = Spec(parameters=parameters)
        for name, value in zip(spec.parameter_names, spec.parameter_values, strict=True):
            numbers[self.rollout.index(f"{block}.{name}")] = value


def applicable(effects: Sequence[Effect] | None, body: Body) -> dict[str, Effect]:
    """Name -> effect, of those that apply to the body; None: of the whole library."""
    return {e.card.name: e for e in (library().values() if effects is None else effects) if e.applies_to(body)}


def replay_of(
    scenario: Scenario, robot: Robot, has: frozenset[str], effects: Sequence[Effect] | None = None, ticks: int = 1,
    count_rad: float = 0.0,
) -> Replay:
    """Build and compile the prediction Diagram.

    Args:
        scenario, robot: the model. has: as `feeds` of a Replay.
        effects: to try, default the whole library. ticks: from one read of the encoders to the next.
        count_rad: of the encoders, as the runs show it.

    Raises:
        InputError: an effect of the model is not among `effects`.
    """
    body = body_of(scenario, robot)
    every = applicable(effects, body)
    if robot.driven == COMMAND and COMMAND not in has:  # what lies between command and wheels cannot show
        every = {name: effect for name, effect in every.items() if not _changes_command(effect)}
    known = {e.card.name: dict(values) for e, values in chosen_effects(getattr(scenario, robot.name).effects)}
    if missing := known.keys() - every.keys():
        raise InputError(f"effects: expected {', '.join(sorted(missing))} among them, which the model has")
    wheels_lead = robot.driven == COMMAND and COMMAND not in has  # without rounding, by Track.turned
    filter = filters_of(scenario, robot, has, ticks, 0.0 if wheels_lead else count_rad)
    nominal = filter(body.plant)
    rollout = compile_diagram(replay_diagram(scenario, robot, nominal, every))
    settling_ticks = nominal.settling_ticks if robot.driven == TORQUE else BLOCK_TICKS
    alone = None
    if robot.driven == COMMAND and has >= {COMMAND, "encoder"}:
        alone = _alone(rollout, body.name, every, filters_of(scenario, robot, has - {COMMAND}, ticks)(body.plant))
    return Replay(body, every, known, rollout, has, filter, len(ASSUMED), settling_ticks, alone)


def _changes_command(effect) -> bool:
    """Whether an effect lies between the commanded velocity and the wheels."""
    return effect.wire == VelocityEffect.wire


def _alone(rollout, robot, effects, filter):
    """`alone` of a Replay; filter: that follows wheels where no command was recorded."""
    own = {f"{robot}_{name}" for name, effect in effects.items() if _changes_command(effect)}
    numbers, names = rollout.parameters.copy(), rollout.parameter_names
    which = [i for i, name in enumerate(names) if name.split(".")[0] in own]
    spec = Spec(parameters={key: value for key, value in numbers_of(filter).items() if key != "weight"})
    for name, value in zip(spec.parameter_names, spec.parameter_values, strict=True):
        which.append(rollout.index(f"{robot}_follower.{name}"))
        numbers[which[-1]] = value
    return np.array(which), numbers[which]


def replay_diagram(scenario: Scenario, robot: Robot, filter: Filter, effects: Mapping[str, Effect]) -> Diagram:
    """The Diagram with every one of `effects` at its neutral value, held on the measurements by `filter`.

    Inputs: command, measured, sighting, and where torque drives the robot force (3,), of the ground on the plant.
    Outputs: innovation and error, of the follower, view, of the camera, and pose, what the camera would report.
    """
    body, settings, bench = body_of(scenario, robot), getattr(scenario, robot.name), Bench()
    part = Part(bench, robot.name)
    noiseless = dataclasses.replace(body.plant, slip=dataclasses.replace(body.plant.slip, noise_std=[0.0, 0.0, 0.0]))
    wires = {"wheel_angle": "follower.modelled", "pose": "view.pose"}
    part.add("follower", Follower(filter))
    part.add("view", RoomView())
    part.add("plant", robot.followed_plant(settings, noiseless))
    if robot.has_imu:
        part.add("outputs", Multiplexer([body.wheels, IMU]))
        part.wire(("plant.body_motion", "outputs.u1"), ("outputs.y0", "follower.modelled"))
        wires |= {"wheel_angle": "outputs.u0", "body_motion": "outputs.u1"}
    if robot.driven == COMMAND:
        wires["velocity"] = "follower.push"
        part.add("command", TorqueActuator(Actuator(), 3))
        part.wire(("command.torque", "follower.push"), ("follower.push", "plant.velocity"))
    else:
        wires |= {"torque": "plant.torque", "ground_force": "follower.push"}
        part.add("command", TorqueActuator(_without_limit_and_noise(settings.actuator), body.wheels))
        part.add("ground", TorqueActuator(Actuator(), 3))
        part.wire(
            ("command.torque", "plant.torque"), ("ground.torque", "follower.push"),
            ("follower.push", "plant.ground_force"),
        )
    part.wire(("plant.wheel_angle", wires["wheel_angle"]), ("plant.pose", "view.pose"))
    neutral = [(effect, effect.neutral(body)) for effect in effects.values() if effect.replayed]
    splice_effects(bench, body, neutral, {wire: [part.block(end)] for wire, end in wires.items()})
    inputs = {"command": "command.command", "measured": "follower.measured", "sighting": "view.sighting"}
    if robot.driven == TORQUE:
        inputs["force"] = "ground.command"
    bench.let_in(**{name: part.block(port) for name, port in inputs.items()})
    view = part.block("view")
    bench.show(
        innovation=part.block("follower.innovation"), error=part.block("follower.error"), view=f"{view}.innovation",
        pose=bench.source(f"{view}.pose"),
    )
    return bench.build(part.block("replay"))


def _without_limit_and_noise(actuator):
    """The actuator without limit, converter steps and noise."""
    return dataclasses.replace(actuator, limit_n_m=None, resolution_n_m=0.0, noise_std_n_m=0.0)
