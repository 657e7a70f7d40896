"""Pages with commands and notebooks, as CI runs them."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
FIRST_DAY, YOUR_DATA = DOCS / "first-day", DOCS / "your-data"
COMMANDS = re.compile(r"^```sh\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def commands(page: Path) -> list[str]:
    """The lines of the blocks marked `sh`, word for word."""
    blocks = COMMANDS.findall(page.read_text(encoding="utf-8"))
    return [line for block in blocks for line in block.splitlines() if line]


def laid_out(folder: Path, page: Path = FIRST_DAY) -> Path:
    """An empty folder with the files that the page in folder `page` says to copy."""
    for file in [*page.glob("*.py"), *page.glob("*.yaml")]:
        shutil.copy(file, folder)
    return folder


def environment() -> dict[str, str]:
    """`gritd` and `python` are those of the tests; figures are drawn without a screen."""
    here = str(Path(sys.executable).parent)
    return {
        **os.environ,
        "PATH": f"{here}{os.pathsep}{os.environ.get('PATH', '')}",
        "MPLBACKEND": "Agg",
    }


def cells(notebook: Path) -> Iterator[str]:
    """The code of a notebook, cell by cell."""
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            yield "".join(cell["source"])


def program(notebook: Path) -> str:
    """A notebook as a program: where a cell ends with a value, it is shown as a notebook shows it,
    so that a value which cannot be shown fails.
    """
    return SHOW + "\n".join(_shown(cell) for cell in cells(notebook))


SHOW = """\
def show(value):
    if value is not None:
        as_html = getattr(value, "_repr_html_", None)
        print(repr(value) if as_html is None else f"html of {len(as_html())} characters")
"""


def _shown(cell: str) -> str:
    tree = ast.parse(cell)
    if tree.body and isinstance(tree.body[-1], ast.Expr):
        value = tree.body[-1].value
        named = ast.Name("show", ast.Load())
        tree.body[-1] = ast.Expr(ast.Call(func=named, args=[value], keywords=[]))
    return ast.unparse(ast.fix_missing_locations(tree))
