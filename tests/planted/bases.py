"""Sets of sound recordings, and of robots with one hidden effect, that mistakes are planted into."""

from pathlib import Path

from drake_ispace.files.importers import optiodom
from drake_ispace.files.recording import Recording
from hidden.generator import generate

DATA = Path(__file__).parents[2] / ".." / "shared" / "data"
_MOTIONS = ("square", "eight", "circle")
_EFFECTS = {
    "wheel_radius_error": {"share": 0.05}, "camera_latency": {"latency_s": 0.08},
    "coulomb_friction": {"torque_n_m": 0.01}, "mass_error": {"share": 0.3}, "track_error": {"share": 0.06},
}


def simulated(robot: str, seconds: float, seed: int, effect: str | None = None, runs: int = 3) -> list[Recording]:
    """Runs of a robot, sound or with one effect at a clearly visible size."""
    hidden = {} if effect is None else {effect: _EFFECTS[effect]}
    return [generate(robot, motion, hidden, seconds, seed + i) for i, motion in enumerate(_MOTIONS[:runs])]


def bases(names: list[str], seconds: float, seed: int) -> dict[str, tuple[str, list[Recording]]]:
    """Name -> model and runs. Names: omni, pendulum, each also as robot+effect; omni3, diff: OptiOdom's, if there."""
    found = {}
    for name in names:
        robot, _, effect = name.partition("+")
        if robot in ("omni", "pendulum"):
            found[name] = f"{robot}_multirate", simulated(robot, seconds, seed, effect or None)
        elif (folder := DATA / "optiodom" / robot).is_dir():
            kinds = ("circular", "square", "joystick" if robot == "omni3" else "free")
            found[name] = f"optiodom_{robot}", [optiodom.load_folder(folder / kind)[0] for kind in kinds]
    return found


ALL = [robot + effect for robot in ("omni", "pendulum") for effect in ("", *(f"+{name}" for name in _EFFECTS))]
REAL = ["omni3", "diff"]
