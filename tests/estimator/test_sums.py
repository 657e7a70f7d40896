"""A recording is verified by other versions of Python and on other processors: no float is added in
an order, or by a method, that they choose.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
ALLOWED = {"estimator/compiled/arithmetic.py": 1}  # integer_sum, which mypy holds to integers
BANNED = {"fsum", "sumprod", "statistics"}


def sums(tree: ast.AST) -> Iterator[str]:
    """Lines that sum by a method of Python's."""
    for node in ast.walk(tree):
        found: set[str] = set()
        if isinstance(node, ast.Name):
            found = {node.id} & {"sum"}
        elif isinstance(node, ast.Attribute):
            found = {node.attr} & {"fsum", "sumprod"}
        elif isinstance(node, ast.ImportFrom):
            found = {node.module or "", *(alias.name for alias in node.names)} & BANNED
        elif isinstance(node, ast.Import):
            found = {alias.name for alias in node.names} & BANNED
        yield from (f"line {node.lineno}: {name}" for name in found)  # type: ignore[attr-defined]


def test_estimator_adds_floats_in_one_order() -> None:
    for path in sorted((ROOT / "estimator").rglob("*.py")):
        place = str(path.relative_to(ROOT))
        found = list(sums(ast.parse(path.read_text("utf-8"))))
        assert len(found) <= ALLOWED.get(place, 0), (
            f"{place}: {found}; expected compiled.arithmetic's total (floats) or integer_sum"
        )
