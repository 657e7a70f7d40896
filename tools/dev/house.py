"""Numbers of a source tree: files, imports between rooms, lengths, constants, docstrings.

    python tools/dev/house.py TREE … [--folder tools/diagnose]

TREE is a checkout; its name heads a column. The table is Markdown. Nothing of the project is
imported, so that any version can be counted.
"""

from __future__ import annotations

import argparse
import ast
import re
import statistics
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

WIDE = 100  # columns
LONG = 12  # lines from which a function has steps to tell apart
PLAIN = {0, 1, 2, -1, 0.5}  # numbers that need no name
ARRAYS = (
    "Array",
    "Bools",
    "Index",
    "NDArray",
    "ndarray",
)  # types of arrays, wherever they are from
SHAPE = re.compile(r"\((?:[A-Za-z\d][^(),]{0,12},)[^()]{0,16}\)")  # (N,), (n, m), (1 + draws,)
TUNING = "tuning"  # the folder of named numbers
Function = ast.FunctionDef | ast.AsyncFunctionDef


def counted(tree: Path, folder: str) -> dict[str, str]:
    """What a table says of the Python files of a folder."""
    paths = sorted((tree / folder).rglob("*.py"))
    texts = {path: path.read_text(encoding="utf-8") for path in paths}
    parsed = {path: ast.parse(text) for path, text in texts.items()}
    lines = [line for text in texts.values() for line in text.splitlines()]

    functions = [f for p in parsed.values() for f in ast.walk(p) if isinstance(f, Function)]
    lengths = sorted((f.end_lineno or f.lineno) - f.lineno + 1 for f in functions)
    arrays = [f for p in parsed.values() for f in _outermost(p) if _on_arrays(f, _arrays_in(p))]
    stated = sum(bool(SHAPE.search(ast.get_docstring(f) or "")) for f in arrays)

    home = tree / folder
    rooms = {_room(path, home) for path in paths if path.stem != "__init__"}
    rest = [p for path, p in parsed.items() if TUNING not in path.parts]
    wide = sum(len(line) > WIDE for line in lines)
    return {
        "files": str(sum(bool(t.strip()) for t in texts.values())),
        "rooms, arrows between them": f"{len(rooms)}, {len(_arrows(parsed, home, folder, rooms))}",
        "lines of the longest file": str(max(len(t.splitlines()) for t in texts.values())),
        "lines of a function: median, 90 %": f"{statistics.median(lengths):.0f},"
        f" {lengths[int(0.9 * len(lengths))]}",
        f"functions of {LONG} lines or more with a blank line between steps": _share(
            [f for path, p in parsed.items() for f in _stepped(p, texts[path].splitlines())]
        ),
        f"lines over {WIDE} columns": f"{wide} of {len(lines)} ({wide / len(lines):.1%})",
        "numbers with a name in a room's module": str(sum(_named(p) for p in rest)),
        "numbers without a name": str(sum(_inline(p) for p in rest)),
        "numbers in one place, with a reason": str(
            sum(_fields(p) for path, p in parsed.items() if TUNING in path.parts)
        ),
        "public functions on arrays that state shapes": f"{stated} of {len(arrays)}",
    }


def _stepped(module: ast.Module, lines: list[str]) -> Iterator[bool]:
    """Of every long function with more than one statement, whether a blank line stands in it."""
    for node in ast.walk(module):
        if isinstance(node, Function) and (node.end_lineno or 0) - node.lineno + 1 >= LONG:
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            if len(body) > 1:
                own = lines[body[0].lineno - 1 : node.end_lineno]
                yield not all(line.strip() for line in own)


def _share(marks: list[bool]) -> str:
    return f"{sum(marks)} of {len(marks)} ({sum(marks) / max(len(marks), 1):.0%})"


def _room(path: Path, home: Path) -> str:
    """Its folder in the house, or its own name where it stands loose."""
    parts = path.relative_to(home).with_suffix("").parts
    return parts[0]


def _arrows(
    parsed: dict[Path, ast.Module], home: Path, folder: str, rooms: set[str]
) -> set[tuple[str, str]]:
    """Which room imports which other one."""
    prefix = folder.replace("/", ".") + "."
    arrows = set()

    for path, module in parsed.items():
        here = _room(path, home)
        for name in _imported(module):
            _, inside, rest = f".{name}".partition(f".{prefix}")
            there = rest.split(".")[0]
            if inside and there in rooms and there != here:
                arrows.add((here, there))

    return arrows


def _imported(module: ast.Module) -> Iterator[str]:
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _outermost(module: ast.Module) -> Iterator[Function]:
    """Functions and methods, but none inside a function: nobody else can call those."""
    for node in module.body:
        inside = node.body if isinstance(node, ast.ClassDef) else [node]
        yield from (each for each in inside if isinstance(each, Function))


def _arrays_in(module: ast.Module) -> re.Pattern[str]:
    """Names of array types in a module: the usual ones, and those that it defines."""
    own = [
        n for n in module.body if isinstance(n, ast.Assign) and "NDArray" in ast.unparse(n.value)
    ]
    names = [t.id for n in own for t in n.targets if isinstance(t, ast.Name)]
    return re.compile(rf"\b({'|'.join([*ARRAYS, *names])})\b")


def _on_arrays(function: Function, array: re.Pattern[str]) -> bool:
    every = [*function.args.args, *function.args.kwonlyargs]
    kinds = [a.annotation for a in every if a.annotation] + [function.returns]
    public = not function.name.startswith("_")
    return public and any(k is not None and bool(array.search(ast.unparse(k))) for k in kinds)


def _numbers(node: ast.AST) -> list[float]:
    return [
        n.value
        for n in ast.walk(node)
        if isinstance(n, ast.Constant)
        and isinstance(n.value, int | float)
        and not isinstance(n.value, bool)
    ]


def _assigned(module: ast.Module) -> list[ast.Assign]:
    """Constants of the module that hold a number."""
    return [n for n in module.body if isinstance(n, ast.Assign) and _numbers(n.value)]


def _named(module: ast.Module) -> int:
    return sum(
        isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
        for assigned in _assigned(module)
        for target in assigned.targets
        for name in ast.walk(target)
    )


def _inline(module: ast.Module) -> int:
    """Numbers in functions, but for those that need no name."""
    every = [n for n in _numbers(module) if n not in PLAIN]
    return len(every) - sum(n not in PLAIN for a in _assigned(module) for n in _numbers(a))


def _fields(module: ast.Module) -> int:
    classes = [n for n in module.body if isinstance(n, ast.ClassDef)]
    fields = [n.value for c in classes for n in c.body if isinstance(n, ast.AnnAssign)]
    return sum(isinstance(v, ast.Call) and ast.unparse(v.func) == "tuned" for v in fields)


def main(argv: Sequence[str]) -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description="Numbers of source trees, side by side.")
    parser.add_argument("trees", type=Path, nargs="+", metavar="TREE")
    parser.add_argument("--folder", default="tools/diagnose")
    given = parser.parse_args(argv)

    columns = [counted(tree, given.folder) for tree in given.trees]
    print(f"| `{given.folder}` | {' | '.join(tree.name for tree in given.trees)} |")
    print("|---|" + "--:|" * len(columns))
    for what in columns[0]:
        print(f"| {what} | {' | '.join(column[what] for column in columns)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
