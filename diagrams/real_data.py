"""What the scripts on real measurements share: options, how an answer is printed, dead-reckoned errors."""

import argparse
import dataclasses
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from drake_ispace.explain.answer.explanation import plain
from drake_ispace.explain.decide.joint import decide_jointly
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.predict.prediction import predict
from drake_ispace.explain.predict.replay import replay_of
from drake_ispace.explain.predict.room_gain import with_gain
from drake_ispace.explain.predict.tracks import track
from drake_ispace.files.importers import optiodom
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.robots.library import robots
from drake_ispace.scenario import load_scenario


def arguments(description: str):
    """(options, pool, tell): --data, --json, --runs; tell prints progress unless --json."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    folder = Path(__file__).parents[1] / ".." / "shared" / "data"
    parser.add_argument("--data", type=Path, default=folder, help="folder of the measurements, default ../shared/data")
    parser.add_argument("--json", action="store_true", help="print the answer as JSON alone")
    parser.add_argument("--runs", type=int, help="use so many runs at most of each kind of motion, default all")
    options = parser.parse_args()
    if not options.data.is_dir():
        parser.exit(2, f"{options.data}: expected the folder of real measurements, there is none\n")
    return options, ThreadPoolExecutor(2), lambda text: None if options.json else print(f"  {text}", file=sys.stderr)


def named(decision) -> list[str]:
    """Names of what the model lacks, each with those that the runs cannot tell from it."""
    if decision.named is None:
        return []
    return [
        " or ".join([candidate.name, *dict.fromkeys(r.candidate.name for r in decision.rivals.get(candidate, []))])
        for candidate in decision.named.point
    ]


def verdict(decision) -> str:
    """As in an Explanation."""
    if decision.unknown is not None:
        return "unknown"
    if decision.named is None:
        return "none"
    return "set" if any(decision.rivals.values()) else "named"


def print_answer(options, decision, names, held_out, further) -> None:
    """As JSON, or in lines."""
    said = decision if isinstance(decision, str) else verdict(decision)
    answer = {"named": names, "verdict": said, "held_out": held_out, **further}
    if options.json:
        print(json.dumps(plain(answer), indent=2, allow_nan=False))
        return
    print(f"{answer['verdict']}: {', '.join(names) or 'nothing'}")
    for kind, error in held_out.items():
        smaller = 100.0 * (1.0 - error["after"] / error["before"])
        print(f"  {kind}: {error['before']:.4g} -> {error['after']:.4g} {error['unit']}, {smaller:.0f} % smaller")
    for key, value in further.items():
        print(f"  {key}: {json.dumps(plain(value))}")


def spread(runs: list, count: int | None) -> list:
    """`count` of the runs, evenly taken from the first on; None: all."""
    return runs if count is None or count >= len(runs) else [runs[i * len(runs) // count] for i in range(count)]


def dead_reckoned(prediction, values) -> float:
    """Root mean square distance [m] between camera and odometry from the initial pose of each run, all fixes pooled."""
    replay = with_gain(with_gain(prediction.replay, 0, 0.0), 1, 0.0)
    residuals = dataclasses.replace(prediction, replay=replay).residuals(values)
    squares = np.concatenate([run["room"][:, 0] ** 2 + run["room"][:, 1] ** 2 for run in residuals])
    return float(np.sqrt(np.mean(squares)))


def halves(recording: Recording) -> tuple[Recording, Recording]:
    """The run cut where it rests longest within its middle third, each part with a clock of its own."""
    encoder = recording.channels["encoder"]
    n = len(encoder.t)
    step = max(n // 500, 1)
    moved = np.abs(encoder.values[2 * step :] - encoder.values[: -2 * step]).sum(axis=1)
    cut = encoder.t[step + n // 3 + int(np.argmin(moved[n // 3 : 2 * n // 3]))]
    return _part(recording, encoder.t[0], cut), _part(recording, cut, np.inf)


def _part(recording, start, end):
    channels = {}
    for name, channel in recording.channels.items():
        inside = (channel.t >= start) & (channel.t < end)
        channels[name] = Channel(
            channel.t[inside] - start, channel.columns, channel.values[inside], channel.units, channel.period_s
        )
    return dataclasses.replace(recording, channels=channels)


def explain_odometry(description: str, scenario: str, folder: str, train: str, kinds: tuple[str, ...]) -> None:
    """Name what the odometry of a robot lacks on runs of `train`; print errors of all `kinds` before and after."""
    options, pool, tell = arguments(description)
    model, rover = load_scenario(scenario), robots()["rover"]
    wheels = len(model.rover.plant.nominal_geometry.wheels)

    def tracks(kind):
        runs = spread(optiodom.load_folder(options.data / folder / kind), options.runs)
        return [track(run, rover, wheels, run.notes) for run in runs]

    training = tracks(train)
    replay = replay_of(model, rover, training[0].has)
    tried = candidates(replay.effects, replay.body)
    decision = decide_jointly(predict(replay, training), tried, 0, pool, tell)
    values = {} if decision.named is None else merged(decision.named.point)
    held_out = {}
    for kind in kinds:
        prediction = predict(replay, tracks(kind))
        held_out[kind] = {
            "before": dead_reckoned(prediction, {}), "after": dead_reckoned(prediction, values), "unit": "m",
        }
    print_answer(options, decision, named(decision), held_out, {"parameters": values})
