"""The plain loop in other block-diagram simulators. Run as a program, in any Python where they are installed:

    echo '{"peer": "jaxonomy", "ticks": 400, "repetitions": 2, "constants": {...}}' | python peers.py

Prints {"seconds": CPU time of every repetition, "first_s": the first one with set-up and compile time, "log": positions
and velocities tick by tick, before the updates of the tick}. This file needs nothing of drake_ispace.
"""

import json
import sys
import time
import warnings
from types import SimpleNamespace

import numpy as np

AXES = 3


class Encoder:
    """Reads the position once a tick and filters its difference."""

    def __init__(self, c):
        self.c, self.ticks = c, 0
        self.place, self.speed = np.zeros(AXES), np.zeros(AXES)

    def read(self, position):
        c, now = self.c, self.c.scale * position
        difference = 0.0 if self.ticks == 0 else (now - self.place) / c.tick_s
        self.speed = c.memory * self.speed + (1.0 - c.memory) * difference
        self.place, self.ticks = now, self.ticks + 1
        return np.concatenate([self.place, self.speed])


def run_pathsim(c, ticks, order):
    """One block for each part, as in the other Diagrams; `order` is the order in which they are registered."""
    from pathsim import Connection, Simulation
    from pathsim.blocks import ODE, Wrapper
    from pathsim.solvers import SSPRK33

    log = []
    plant = ODE(lambda x, u, t: np.concatenate([x[AXES:], u / c.mass]), np.zeros(2 * AXES))
    sensor = Encoder(c)
    state = SimpleNamespace(captures=0, seen=-1.0, fix=np.zeros(AXES), captured=np.zeros(AXES))

    def encoder(*x):
        log.append(np.array(x))
        return sensor.read(np.array(x[:AXES]))

    def camera(*p):
        k = c.vision_ticks * state.captures
        state.captures += 1
        return np.array([k, *(np.array(p) + c.bias + c.drift * k)])

    def controller(*u):
        place, speed, stamp, fix = np.array(u[:3]), np.array(u[3:6]), u[6], np.array(u[7:10])
        if stamp > state.seen:
            state.seen, state.fix, state.captured = stamp, fix, place
        return c.k_p * (c.goal - (state.fix + (place - state.captured))) - c.k_d * speed

    blocks = {
        "plant": plant, "encoder": Wrapper(encoder, T=c.tick_s), "camera": Wrapper(camera, T=c.vision_ticks * c.tick_s),
        "controller": Wrapper(controller, T=c.tick_s),
    }
    wires = [Connection(plant[i], blocks["encoder"][i]) for i in range(6)]
    wires += [Connection(plant[i], blocks["camera"][i]) for i in range(3)]
    wires += [Connection(blocks["encoder"][i], blocks["controller"][i]) for i in range(6)]
    wires += [Connection(blocks["camera"][i], blocks["controller"][6 + i]) for i in range(4)]
    wires += [Connection(blocks["controller"][i], plant[i]) for i in range(3)]
    simulation = Simulation([blocks[name] for name in order], wires, dt=c.tick_s, Solver=SSPRK33, log=False)
    started = time.process_time()
    simulation.run(ticks * c.tick_s, adaptive=False)
    seconds = time.process_time() - started
    return seconds, np.array(log)


def run_jaxonomy(c, ticks):
    """Plant and computer; the computer's update is Drake's discrete update, its state the held force."""
    import jax
    import jax.numpy as jnp
    import jaxonomy

    jax.config.update("jax_enable_x64", True)

    class Plant(jaxonomy.LeafSystem):
        def __init__(self):
            super().__init__(name="plant")
            self.declare_input_port()
            self.declare_continuous_state(default_value=jnp.zeros(6), ode=self.ode)
            self.declare_continuous_state_output()

        def ode(self, t, state, force, **parameters):
            x = state.continuous_state
            return jnp.concatenate([x[3:], force / c.mass])

    class OnBoard(jaxonomy.LeafSystem):
        """x_d = [encoder (3), its rate (3), fix (3), encoder at capture (3), force (3), tick]."""

        def __init__(self):
            super().__init__(name="computer")
            self.declare_input_port()
            self.declare_discrete_state(default_value=jnp.zeros(16))
            self.declare_periodic_update(self.step, period=c.tick_s, offset=0.0)
            self.declare_output_port(lambda t, state, *u, **p: state.discrete_state[12:15], requires_inputs=False)

        def step(self, t, state, x, **parameters):
            d, p = state.discrete_state, x[:3]
            k = d[15]
            now = c.scale * p
            speed = c.memory * d[3:6] + (1.0 - c.memory) * jnp.where(k == 0, 0.0, (now - d[:3]) / c.tick_s)
            due = k % c.vision_ticks == 0
            fix = jnp.where(due, p + c.bias + c.drift * k, d[6:9])
            captured = jnp.where(due, now, d[9:12])
            force = c.k_p * (c.goal - (fix + (now - captured))) - c.k_d * speed
            return jnp.concatenate([now, speed, fix, captured, force, jnp.array([k + 1.0])])

    builder = jaxonomy.DiagramBuilder()
    plant, computer = builder.add(Plant(), OnBoard())
    builder.connect(plant.output_ports[0], computer.input_ports[0])
    builder.connect(computer.output_ports[0], plant.input_ports[0])
    diagram = builder.build()
    options = jaxonomy.SimulatorOptions(
        ode_solver_method="rk4", max_minor_step_size=c.tick_s, max_major_steps=2 * ticks + 10,
        buffer_length=4 * ticks + 10, math_backend="jax",
    )
    simulator = jaxonomy.Simulator(diagram, options=options)
    signals = {"x": plant.output_ports[0]}
    context = diagram.create_context()
    advance = jax.jit(lambda end, context: simulator.advance_to(end, context).context.continuous_state)
    jax.block_until_ready(advance(ticks * c.tick_s, context))
    started = time.process_time()
    jax.block_until_ready(advance(ticks * c.tick_s, context))
    seconds = time.process_time() - started
    results = jaxonomy.simulate(diagram, context, (0.0, ticks * c.tick_s), options=options, recorded_signals=signals)
    at = np.asarray(results.time) / c.tick_s
    rows = [int(np.argmin(np.abs(at - k))) for k in range(ticks)]
    return seconds, np.asarray(results.outputs["x"])[rows]


def run_bdsim(c, ticks, first_view):
    """Two clocks; a ZOH on a clock is the only memory, so encoder, its filter and the camera are one each.

    first_view: whether the camera's hold starts with what it would see at t = 0.
    """
    import bdsim

    simulation = bdsim.BDSim(animation=False, graphics=False, progress=False, sysargs=False, quiet=True)
    diagram = simulation.blockdiagram()
    fast, slow = diagram.clock(c.tick_s, "s"), diagram.clock(c.vision_ticks * c.tick_s, "s")
    zero, tick_s = np.zeros(AXES), c.tick_s

    def view(p, t):
        return np.concatenate([p + c.bias + c.drift * round(t / tick_s), c.scale * p])

    def feedback(place, speed, seen):
        return (c.k_p * (c.goal - (seen[:3] + (place - seen[3:]))) - c.k_d * speed) / c.mass

    velocity = diagram.INTEGRATOR(x0=zero, name="velocity")
    position = diagram.INTEGRATOR(x0=zero, name="position")
    now = diagram.FUNCTION(lambda p: c.scale * p, name="now")
    filtered = diagram.FUNCTION(
        lambda now, place, speed: c.memory * speed + (1.0 - c.memory) * (now - place) / tick_s, nin=3, name="filtered",
    )
    seen = diagram.FUNCTION(view, nin=2, name="seen")
    force = diagram.FUNCTION(feedback, nin=3, name="force")
    encoder, speed = (diagram.ZOH(fast, x0=zero, name=name) for name in ("encoder", "speed"))
    camera = diagram.ZOH(slow, x0=view(zero, 0.0) if first_view else np.zeros(2 * AXES), name="camera")
    diagram.connect(velocity, position)
    diagram.connect(position, now, seen[0])
    diagram.connect(diagram.TIME(), seen[1])
    diagram.connect(now, encoder, filtered[0])
    diagram.connect(encoder, filtered[1], force[0])
    diagram.connect(speed, filtered[2], force[1])
    diagram.connect(filtered, speed)
    diagram.connect(seen, camera)
    diagram.connect(camera, force[2])
    diagram.connect(force, velocity)
    diagram.compile()
    started = time.process_time()
    out = simulation.run(diagram, ticks * tick_s, dt=tick_s, max_step=tick_s)
    seconds = time.process_time() - started
    names = [str(name) for name in out.xnames]
    columns = [i for what in ("position", "velocity") for i, name in enumerate(names) if name.startswith(what)]
    at = np.asarray(out.t) / tick_s
    x = np.asarray(out.x)[:, columns]
    return seconds, np.array([x[int(np.argmin(np.abs(at - k)))] for k in range(ticks)])


def run_control(c, ticks):
    """The plant sampled at 5 ms by hand and the whole computer as one nonlinear update that asks what time it is."""
    import control

    continuous = control.ss([[0.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y", name="plant")
    sampled = control.ss([[0.0]], [[1.0]], [[1.0]], 0.0, c.tick_s, inputs="y", outputs="u", name="computer")
    try:
        control.interconnect([continuous, sampled], inputs=[], outputs="y")
        refusal = "accepted"
    except ValueError as error:
        refusal = str(error)

    def update(t, s, u, parameters):
        k = round(t / c.tick_s)
        x, place, speed, fix, captured = s[:6], s[6:9], s[9:12], s[12:15], s[15:18]
        now = c.scale * x[:3]
        speed = c.memory * speed + (1.0 - c.memory) * (0.0 if k == 0 else (now - place) / c.tick_s)
        if k % c.vision_ticks == 0:
            fix, captured = x[:3] + c.bias + c.drift * k, now
        a = (c.k_p * (c.goal - (fix + (now - captured))) - c.k_d * speed) / c.mass
        h = c.tick_s
        return np.concatenate([x[:3] + h * x[3:] + 0.5 * h * h * a, x[3:] + h * a, now, speed, fix, captured])

    system = control.nlsys(update, lambda t, s, u, parameters: s[:6], inputs=0, outputs=6, states=18, dt=c.tick_s)
    times = np.arange(ticks) * c.tick_s
    started = time.process_time()
    response = control.input_output_response(system, times, np.zeros((0, ticks)), np.zeros(18))
    return time.process_time() - started, response.outputs.T, refusal


def main():
    request = json.load(sys.stdin)
    c = SimpleNamespace(**{k: np.array(v) if isinstance(v, list) else v for k, v in request["constants"].items()})
    ticks, name = request["ticks"], request["peer"]
    warnings.simplefilter("ignore")
    seconds, extra, log = [], {}, None
    started = time.process_time()
    for _ in range(request["repetitions"]):
        if name.startswith("pathsim"):
            order = ["plant", "encoder", "camera", "controller"]
            taken, log = run_pathsim(c, ticks, order if name == "pathsim" else order[::-1])
        elif name.startswith("bdsim"):
            taken, log = run_bdsim(c, ticks, first_view=name == "bdsim")
        else:
            taken, log, *said = {"jaxonomy": run_jaxonomy, "control": run_control}[name](c, ticks)
            extra = {"said": said[0]} if said else {}
        seconds.append(taken)
        extra.setdefault("first_s", time.process_time() - started)
    json.dump({"seconds": seconds, "log": np.asarray(log)[:ticks].tolist(), **extra}, sys.stdout)


if __name__ == "__main__":
    main()
