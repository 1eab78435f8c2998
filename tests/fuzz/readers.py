"""The readers under attack: for each how a hostile input is made, and what must hold of one that is accepted.

A reader may accept an input or refuse it with an InputError. What it accepts must be what an independent strict parser
finds in it (strict.py), or where nothing may change at all, what stood there before.
"""

import itertools
import math
import re
import shutil
from pathlib import Path

import cv2
import numpy as np

from drake_ispace.cli.explain import _read_effect
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.files.recording_tables import read_table
from drake_ispace.robots.recordings import load
from drake_ispace.rollout.many.campaign import montecarlo
from drake_ispace.rollout.many.draws import parse_distribution, split_vary
from drake_ispace.scenario import load_scenario
from drake_ispace.vision.footage.frames import frames
from drake_ispace.vision.footage.learn import read_pointed
from drake_ispace.vision.footage.scene_file import load_scene
from fuzz import strict
from fuzz.log_readers import LOG_READERS
from fuzz.mutate import damaged, rewritten
from fuzz.reader import Reader, Silent, YamlFile, agree, same, strictly, written

_FACTORS = {  # units in SI
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "rad": 1.0, "mrad": 1e-3,
    "deg": math.pi / 180.0, "rev": 2.0 * math.pi, "N*m": 1.0, "N*cm": 1e-2, "N*mm": 1e-3, "mN*m": 1e-3, "N": 1.0,
    "A": 1.0, "V": 1.0, "1": 1.0,
}


def run(rows: int = 12) -> Recording:
    """A short run with every kind of column."""
    t, wave = 0.005 * np.arange(rows), np.linspace(-1.25, 3.5, rows)
    wheels, late = np.column_stack([wave, 2 * wave, -wave, 0.1 + wave]), 0.095 * np.arange(rows)
    seen = np.column_stack([wave, -wave, 0.3 * wave, late + 0.031])
    return Recording("omni", "omni_multirate", {
        "encoder": Channel(t, tuple(f"theta_{i}" for i in range(1, 5)), wheels, period_s=0.005),
        "torque": Channel(t, tuple(f"tau_{i}" for i in range(1, 5)), 0.01 * wheels),
        "kinect": Channel(late, ("x", "y", "phi", "t_received"), seen, period_s=0.095),
    }, "a note: with a colon")


class Csv(Reader):
    """A table, alone."""

    def __init__(self, folder):
        super().__init__(folder)
        rows = ["t,x,y,phi,t_received"] + [",".join(map(repr, row)) for row in np.random.default_rng(0).normal(
            size=(8, 5)).tolist()]
        self.seeds = ["\n".join(rows) + "\n", "\r\n".join(rows), '"t","x"\n0.0,"1e-3"\n 0.5 ,+2\n\n', "t\n1\n2\n"]

    def input(self, source):
        text = source.choice(self.seeds)
        if source.random() < 0.3:
            return damaged(text.encode(), source)
        return rewritten(text, source).encode("utf-8", "surrogatepass")

    def attack(self, given):
        path = self.folder / "kinect.csv"
        path.write_bytes(given)
        table = read_table(path)
        names, values = strictly(strict.csv_table, given)
        if table.names != names or not np.array_equal(table.values, values):
            raise Silent("names or numbers are others")


class Stamps(Reader):
    """The camera's table in its run: stamps in order, received no earlier than they were made."""

    def __init__(self, folder):
        super().__init__(folder)
        run().save(folder / "run")
        self.seed = (folder / "run" / "kinect.csv").read_text()

    def input(self, source):
        text = self.seed
        if source.random() < 0.5:  # a stamp that is near another one
            lines = text.split("\n")
            row = source.randrange(1, len(lines) - 1)
            cells = lines[row].split(",")
            cells[source.choice((0, 4))] = source.choice((
                repr(0.095 * source.randrange(14)), repr(source.uniform(-1.0, 2.0)), "-0.0", "1e308", cells[0]
            ))
            lines[row] = ",".join(cells)
            text = "\n".join(lines)
        return (text if source.random() < 0.3 else rewritten(text, source)).encode("utf-8", "surrogatepass")

    def attack(self, given):
        (self.folder / "run" / "kinect.csv").write_bytes(given)
        channel = load(self.folder / "run").channels["kinect"]
        names, values = strictly(strict.csv_table, given)
        t = values[:, names.index("t")]
        if not (np.diff(t) > 0.0).all() or not np.array_equal(channel.t, t):
            raise Silent("stamps are out of order, or others")
        if "t_received" in names and not (values[:, names.index("t_received")] >= t).all():
            raise Silent("received before it was made")
        if not all(np.array_equal(channel.column(n), values[:, names.index(n)]) for n in channel.columns):
            raise Silent("numbers are others")


class RecordingYaml(Reader):
    """The description of a run."""

    def __init__(self, folder):
        super().__init__(folder)
        run().save(folder / "run")
        self.path = folder / "run" / "recording.yaml"
        self.seed = self.path.read_text()
        self.tables = {
            name: strict.csv_table((folder / "run" / f"{name}.csv").read_bytes())
            for name in ("encoder", "torque", "kinect")
        }

    def input(self, source):
        text = self.seed
        if source.random() < 0.3:
            units = [unit for unit in _FACTORS if unit in text]
            old, new = source.choice(units), source.choice(list(_FACTORS))
            text = text.replace(f": {old}\n", f": {new}\n", source.choice((1, 9)))
        return rewritten(text, source)

    def attack(self, given):
        recording = load(written(self.path, given).parent)
        tree = strictly(strict.yaml_tree, given)
        known = {"robot": recording.robot, "scenario": recording.scenario or "", "notes": recording.notes}
        agree(known, given, {key: value for key, value in tree.items() if key in known})
        if set(recording.channels) != set(tree["channels"]):
            raise Silent("channels are others")
        for name, entry in tree["channels"].items():
            self._compare(recording.channels[name], entry)

    def _compare(self, channel, entry):
        names, values = self.tables[Path(entry["file"]).stem]
        units = entry.get("units") or {}
        for name in ("t", *channel.columns):
            spelled = re.sub(r"\s", "", str(units.get(name, "1"))).replace("Nm", "N*m").replace("**", "^")
            if name not in units:
                factor = 1.0
            elif spelled in _FACTORS:
                factor = _FACTORS[spelled]
            else:
                continue  # a unit of some other spelling
            wanted = values[:, names.index(name)] * factor
            found = channel.t if name == "t" else channel.column(name)
            if not np.allclose(found, wanted, rtol=1e-14, atol=0.0):
                raise Silent(f"{name} is another")


class Parquet(Reader):
    """A sealed table in its run: nothing may change."""

    def __init__(self, folder):
        super().__init__(folder)
        run().save(folder / "run", "parquet")
        self.before, self.path = load(folder / "run"), folder / "run" / "kinect.parquet"
        self.seed = self.path.read_bytes()

    def input(self, source):
        return damaged(self.seed, source)

    def attack(self, given):
        self.path.write_bytes(given)
        found, wanted = load(self.path.parent).channels["kinect"], self.before.channels["kinect"]
        if found.columns != wanted.columns or not np.array_equal(
            np.column_stack([found.t, found.values]), np.column_stack([wanted.t, wanted.values])
        ):
            raise Silent("rows, columns or numbers are others")


class LooseParquet(Parquet):
    """A table whose seal somebody took out: foreign bytes, which may mean anything."""

    def __init__(self, folder):
        super().__init__(folder)
        text = (folder / "run" / "recording.yaml").read_text()
        kept = [line for line in text.split("\n") if not re.match(r"\s*sha256:", line)]
        (folder / "run" / "recording.yaml").write_text("\n".join(kept))

    def attack(self, given):
        self.path.write_bytes(given)
        found = load(self.path.parent).channels["kinect"]
        if not np.isfinite(found.values).all() or not (np.diff(found.t) > 0.0).all():
            raise Silent("numbers that no table may hold")


class ScenarioFile(YamlFile):
    """A scenario."""

    load = staticmethod(load_scenario)
    SEEDS = (
        "diagram: omni_multirate\nseconds: 3.5\nseed: 7\nomni:\n  plant: {mass_kg: 7.5, wheel_radius_m: 0.05}\n"
        "  initial_pose: [0.1, -0.2, 0.3]\n  effects:\n    coulomb_friction: {torque_n_m: 0.01}\nspace:\n"
        "  width_m: 3.0\n  localizer:\n    whole_pixels: false\n    pixel_m: [0.004, 0.005]\n    latency_ticks: 7\n",
        "diagram: pendulum_multirate\npendulum:\n  plant:\n    body_mass_kg: 3.25\n  trajectory:\n    kind: circle\n"
        "  control:\n",
        "# all by default\nseconds: 1e1\n",
    )


class SceneFile(YamlFile):
    """A scene of a real camera."""

    load = staticmethod(load_scene)
    SEEDS = (
        "width_m: 1.5\ndepth_m: 1.3\npixel_m: [0.002, 0.002]\ncamera:\n  size_pixels: [632, 468]\n"
        "points:\n- [10.5, 20, -0.75, 0.65]\n- [600, 22.5, 0.75, 0.65]\n- [598, 450, 0.75, -0.65]\n"
        "- [12, 448, -0.75, -0.65]\nmarkers: {spacing_m: 0.05}\ncolours:\n  red: {hue: [170, 10], saturation: 120}\n"
        "  blue: {hue: [100, 125]}\nrobots:\n  one: {front: red, rear: blue}\n",
        "tracking: {acceleration_m_s2: 2.5, most_speed_m_s: 4}\ncolours:\n  red: {hue: [170, 10]}\n"
        "  blue: {hue: [100, 125], most_value: 200}\nrobots:\n  one:\n    height_m: 0.15\n    start_m: [0.1, -0.2]\n"
        "    markers:\n    - {colour: red, x_m: 0.05, y_m: 0, area_m2: [0.001, 0.002]}\n"
        "    - {colour: blue, x_m: -0.05, y_m: 0.025}\n    - {colour: red, x_m: -0.05, y_m: -0.025}\n",
    )


class SetOption(Reader):
    """--set key=value."""

    SEEDS = (
        "omni.plant.mass_kg=8", "space.localizer.whole_pixels=false", "omni.initial_pose=[0.1, -0.2, 0.3]",
        "seconds=1e1", "omni.effects={coulomb_friction: {torque_n_m: 0.01}}", "omni.trajectory.kind=circle",
        "seed=12", " space.localizer.latency_ticks = 7 ",
    )

    def input(self, source):
        return rewritten(source.choice(self.SEEDS), source)

    def attack(self, given):
        scenario = load_scenario("omni_multirate", [given])
        key, _, text = given.partition("=")
        value = strict.yaml_tree(f"value: {text}\n")["value"]
        for part in reversed(key.strip().split(".")):
            value = {part: value}
        agree(scenario, given, value)


class MarkerOption(Reader):
    """--marker robot:colour:u,v."""

    SEEDS = ("omni:red:320,200.5", "a b:light blue:1e2,-3", "1:2:3,4")

    def input(self, source):
        return rewritten(source.choice(self.SEEDS), source)

    def attack(self, given):
        front, _ = read_pointed([given, given])
        robot, colour, place = given.split(":")
        if (front.robot, front.colour) != (robot, colour) or list(front.pixel) != [float(n) for n in place.split(",")]:
            raise Silent("another marker than was said")


class VaryOption(Reader):
    """--vary key=distribution."""

    SEEDS = (
        "omni_plant.mass_kg=normal(7.3,0.2)", "a.b=uniform(-1, 1e-3)", "x=loguniform(0.1,10)", " y = choice(1, 2, -3) "
    )

    def input(self, source):
        return rewritten(source.choice(self.SEEDS), source)

    def attack(self, given):
        ((key, text),) = split_vary([given]).items()
        found = parse_distribution(text, f"--vary {key}")
        wanted = re.fullmatch(r"\s*(normal|uniform|loguniform|choice)\s*\((.*)\)\s*", given.split("=", 1)[1])
        numbers = wanted and wanted[2].split(",")
        if not numbers or not all(re.fullmatch(r"\s*[-+]?(\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?\s*", n, re.ASCII | re.I)
                                  for n in numbers):
            raise Silent("a strict parser refuses it")
        if (key, found.kind, found.numbers) != (given.split("=")[0].strip(), wanted[1], tuple(map(float, numbers))):
            raise Silent("key, kind or numbers are others")


class EffectOption(Reader):
    """--effect name:parameter=value,..."""

    SEEDS = (
        "coulomb_friction:torque_n_m=0.01", "weak_motor:wheel=2,loss=0.4", "weak_motor:loss=0.4,loss=0.4",
        " floor_tilt : slope_x_rad = 1e-2 ,slope_y_rad=-.1",
    )

    def input(self, source):
        return rewritten(source.choice(self.SEEDS), source)

    def attack(self, given):
        name, values = _read_effect(given)
        pairs = [part.split("=", 1) for part in given.split(":", 1)[1].split(",")]
        wanted = {key.strip(): strict.yaml_tree(f"value: {text}\n")["value"] for key, text in pairs}
        if len(wanted) != len(pairs) or name != given.split(":", 1)[0].strip() or not same(values, wanted):
            raise Silent("name or numbers are others")


class CampaignFolder(Reader):
    """The folder of a campaign, resumed: the table is the one that it was, or the folder is refused."""

    def __init__(self, folder):
        super().__init__(folder)
        scenario = load_scenario("omni_multirate", ["seconds=0.1"])
        vary = {"omni_plant.mass_kg": "normal(7.3,0.2)"}
        self.plan = {"scenarios": scenario, "runs": 6, "vary": vary, "seed": 3, "threads": 1}
        self.table = montecarlo(out=folder / "whole", **self.plan).table
        self.files = sorted(path.name for path in (folder / "whole").iterdir())

    def input(self, source):
        name = source.choice(self.files)
        data = (self.folder / "whole" / name).read_bytes()
        if name.endswith(".yaml") and source.random() < 0.7:
            return name.encode() + b"\n" + rewritten(data.decode(), source).encode("utf-8", "surrogatepass")
        return name.encode() + b"\n" + damaged(data, source)

    def attack(self, given):
        name, _, data = given.partition(b"\n")
        folder = self.folder / "hurt"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.folder / "whole", folder)
        (folder / name.decode()).write_bytes(data)
        if not montecarlo(out=folder, **self.plan).table.equals(self.table):
            raise Silent("the table is another")


class Images(Reader):
    """Pictures and a video."""

    def __init__(self, folder):
        super().__init__(folder)
        picture = np.random.default_rng(1).integers(0, 255, (9, 14, 3), np.uint8)
        self.seeds = {end: cv2.imencode(end, picture)[1].tobytes() for end in (".png", ".bmp", ".jpg", ".tif", ".webp")}
        writer = cv2.VideoWriter(str(folder / "seed.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (32, 24))
        for shade in (0, 90, 200):
            writer.write(np.full((24, 32, 3), shade, np.uint8))
        writer.release()
        self.seeds[".avi"] = (folder / "seed.avi").read_bytes()

    def input(self, source):
        end = source.choice(sorted(self.seeds))
        return end.encode() + b"\n" + damaged(self.seeds[end], source)

    def attack(self, given):
        end, _, data = given.partition(b"\n")
        path = self.folder / f"picture{end.decode()}"
        path.write_bytes(data)
        found = [image for _, image in itertools.islice(frames(path), 100)]
        if end == b".png":
            if not np.array_equal(found[0], strictly(strict.png_pixels, data)):
                raise Silent("pixels are others")


READERS: dict[str, type[Reader]] = {
    "recording.yaml": RecordingYaml, "csv": Csv, "parquet": Parquet, "loose-parquet": LooseParquet, "stamps": Stamps,
    "scenario": ScenarioFile, "scene": SceneFile, "set": SetOption, "vary": VaryOption, "effect": EffectOption,
    "marker": MarkerOption,
    "campaign": CampaignFolder, "images": Images,
} | LOG_READERS
