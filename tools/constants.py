"""List every number of `explain` that can change a verdict: the constants of its modules, with what is said of each.

    python tools/constants.py [FOLDER]

Cards of effects, faults and robots, and numbers that a user passes, are elsewhere and not counted.
"""

import ast
import sys
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "src" / "drake_ispace" / "explain"


def numbers_in(node: ast.AST) -> int:
    """How many numbers an expression has."""
    return sum(isinstance(part, ast.Constant) and type(part.value) in (int, float) for part in ast.walk(node))


def constants(file: Path) -> list[tuple[str, int, str]]:
    """(name, how many numbers, the comment beside it) of every constant of a module that holds numbers."""
    text = file.read_text(encoding="utf-8")
    lines, found = text.splitlines(), []
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)]
        if names and all(name.strip("_").isupper() for name in names):
            comment = lines[node.end_lineno - 1].partition("  # ")[2]
            found.append((", ".join(names), numbers_in(node.value), comment))
    return [one for one in found if one[1]]


def main():
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    total = 0
    for file in sorted(folder.rglob("*.py")):
        for name, count, comment in constants(file):
            total += count
            print(f"{file.relative_to(folder)}: {name} ({count}) {comment}")
    print(f"{total} numbers")


if __name__ == "__main__":
    main()
