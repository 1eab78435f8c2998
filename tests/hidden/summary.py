"""What a campaign's records come to: one row per target, with the figure reached."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import binomtest

LEAST_DETECTABILITY = 5.0  # of an effect, in standard deviations, from which on the targets hold
DISTINCT = 0.95  # |cosine| to every other effect's signature below which an effect should be named alone


def returned(record: dict) -> set[str]:
    """Every name of the answer."""
    return {*record["names"], *(other for others in record["equivalents"] for other in others)}


def is_detected(record: dict) -> bool:
    return record["verdict"] != "none"


def is_alone(record: dict) -> bool:
    """Whether the true name, and no other, was returned."""
    return record["verdict"] == "named" and returned(record) == {record["name"]}


def is_inside(record: dict) -> bool:
    """Whether the true name was returned, alone or among others."""
    return record["verdict"] in ("named", "set") and record["name"] in returned(record)


def is_wrong(record: dict) -> bool:
    """Whether a single effect was named and it is not the true one."""
    return record["verdict"] == "named" and record["name"] not in returned(record)


def has_doubts(record: dict) -> bool:
    """Whether it was said that there is something that no named effect stands for."""
    return record["verdict"] in ("unknown", "incomplete")


def has_more(record: dict) -> bool:
    """Whether more effects than one were said to be missing at once."""
    return len(record["names"]) > 1


def likeness_of(records: Sequence[dict], record: dict) -> float:
    """The largest |cosine| of an effect's signature to another's, 0 where it was not measured."""
    known = next((r for r in records if r["kind"] == "likeness" and r["robot"] == record["robot"]), None)
    return known["nearest"].get(record["name"], ["", 0.0])[1] if known else 0.0


def share_of(records: Sequence[dict], is_so: Callable[[dict], bool]) -> tuple[int, int]:
    return sum(map(is_so, records)), len(records)


def rate(hits: int, of: int) -> str:
    """Share with its 95 % binomial interval, in percent."""
    if not of:
        return "-"
    low, high = binomtest(hits, of).proportion_ci(method="exact")
    return f"{100 * hits / of:.1f} % [{100 * low:.1f}, {100 * high:.1f}] ({hits} of {of})"


def judged(records: Sequence[dict], kind: str) -> list[dict]:
    """Records of a kind with an answer."""
    return [r for r in records if r["kind"] == kind and r["verdict"] not in ("lost", "error")]


def clear(records: Sequence[dict]) -> list[dict]:
    """Hidden effects of the library that were found, with LEAST_DETECTABILITY and more."""
    return [r for r in judged(records, "effect") if is_detected(r) and r["detectability"] >= LEAST_DETECTABILITY]


def rows(records: Sequence[dict]) -> list[tuple[str, str, str]]:
    """(quantity, figure, target)."""
    found = clear(records)
    distinct = [r for r in found if likeness_of(records, r) < DISTINCT]
    named = [r for r in found if r["verdict"] in ("named", "set")]
    parameters = [p for r in found if len(r["names"]) == 1 for p in r["parameters"].values() if p["error"] is not None]
    gaps = [r["closed"] for r in found if r["closed"] is not None]
    nothing, unknown = judged(records, "none"), [r for r in judged(records, "unknown") if is_detected(r)]
    sizes = [len(returned(r)) for r in named]
    table = [
        ("effects found, clear (5 sigma and more)", f"{len(found)} of {len(judged(records, 'effect'))}", ""),
        ("true name alone or in the set", rate(*share_of(found, is_inside)), ">= 97 %"),
        ("true name alone, cosine to every rival < 0.95", rate(*share_of(distinct, is_alone)), ">= 85 %"),
        ("a wrong name alone", rate(*share_of(found, is_wrong)), "<= 1 %"),
        ("more than one effect named", rate(*share_of(found, has_more)), ""),
        ("'unknown' said of a library effect", rate(*share_of(found, lambda r: r["verdict"] == "unknown")), ""),
        ("'incomplete' said of a library effect", rate(*share_of(found, lambda r: r["verdict"] == "incomplete")), ""),
        ("mean size of the set", _number(np.mean(sizes) if sizes else None), "<= 1.3"),
        ("false alarms, all noise levels", rate(*share_of(nothing, is_detected)), "0.3 to 2 %"),
    ]
    for noise in sorted({r["noise"] for r in nothing}):
        own = [r for r in nothing if r["noise"] == noise]
        table.append((f"false alarms, process noise x {noise:g}", rate(*share_of(own, is_detected)), "0.3 to 2 %"))
    errors, covered = [p["error"] for p in parameters], [p["covers"] for p in parameters]
    return table + [
        ("median parameter error", _percent(np.median(errors) if errors else None), "<= 3 %"),
        ("90 % intervals that cover", rate(sum(covered), len(covered)), "85 to 95 %"),
        ("gap in metres small beside noise", f"{len(found) - len(gaps)} of {len(found)}", ""),
        ("held-out gap closed, median", _percent(np.median(gaps) if gaps else None), ">= 95 %"),
        ("held-out gap closed, 10th percentile", _percent(np.quantile(gaps, 0.1) if gaps else None), ">= 85 %"),
        ("unknown effect: found", rate(len(unknown), len(judged(records, "unknown"))), ""),
        ("unknown effect: 'unknown' or 'incomplete'", rate(*share_of(unknown, has_doubts)), ""),
        ("unknown effect: one wrong name", rate(*share_of(unknown, lambda r: r["verdict"] == "named")), "<= 5 %"),
        ("median seconds of a diagnosis", _number(_median_seconds(records)), "<= 60"),
        ("robot lost / error", f"{_count(records, 'lost')} / {_count(records, 'error')}", ""),
    ]


def failures(records: Sequence[dict]) -> list[dict]:
    """Records to look at: a clear effect not inside of the answer or with company, a false alarm, an unknown named."""
    bad = [r for r in clear(records) if not is_inside(r) or has_more(r)]
    bad += [r for r in judged(records, "effect") if not is_detected(r) and r["factor"] >= 0.5]
    bad += [r for r in judged(records, "none") if is_detected(r)]
    bad += [r for r in judged(records, "unknown") if r["verdict"] == "named"]
    return bad + [r for r in records if r.get("verdict") in ("lost", "error")]


def print_summary(records: Sequence[dict]) -> None:
    """The table in Markdown, a column for each robot where there are two."""
    robots = sorted({r["robot"] for r in records})
    groups = {"both robots": robots} if len(robots) > 1 else {}
    groups |= {robot: [robot] for robot in robots}
    tables = {title: rows([r for r in records if r["robot"] in group]) for title, group in groups.items()}
    targets = {quantity: target for table in tables.values() for quantity, _, target in table}
    figures = {title: {quantity: figure for quantity, figure, _ in table} for title, table in tables.items()}
    print("| | target |", " | ".join(figures), "|")
    print("|---|---|" + "---|" * len(figures))
    for quantity, target in targets.items():
        print(f"| {quantity} | {target} |", " | ".join(own.get(quantity, "-") for own in figures.values()), "|")


def _median_seconds(records):
    seconds = [r["seconds"] for r in records if "seconds" in r]
    return np.median(seconds) if seconds else None


def _count(records, verdict):
    return sum(r.get("verdict") == verdict for r in records)


def _number(value):
    return "-" if value is None else f"{value:.2f}"


def _percent(value):
    return "-" if value is None else f"{100 * value:.1f} %"
