"""The plant shares no physics with what it judges, and the proof none with the diagnosis: by
imports, and when run.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[4]
PROOF = ROOT / "tools" / "proof" / "blind"
FILES = sorted(PROOF.rglob("*.py"))
# The formats of a recording, and the configuration's default text; nothing that computes with soil.
ALLOWED = (
    "gritd.config",
    "gritd.estimator.messages.readings",
    "gritd.estimator.messages.run_info",
    "gritd.estimator.recording.run_writer",
    "gritd.tools.cli.command",
    "gritd.tools.cli.offspring",
    "gritd.tools.cli.progress",
    "gritd.tools.cli.workers",
    "gritd.tools.proof.blind",
)
JUDGED = (
    "gritd.estimator.effects",
    "gritd.estimator.model.forward",
    "gritd.estimator.model.balance",
    "gritd.estimator.terramechanics",
    "gritd.tools.diagnose",
)


def imported(path: Path) -> set[str]:
    """Modules that a file imports, anywhere in it, `from a import b` counted as both a and a.b."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Call) and getattr(
            node.func, "attr", getattr(node.func, "id", "")
        ) in (
            "import_module",
            "__import__",
        ):
            pytest.fail(f"{path}: imports by name")

    return found


def ours(module: str) -> bool:
    """A module of this project; a package alone, `from gritd import config`, is judged by what it
    hands on.
    """
    first, *rest = module.split(".")
    return bool(rest) and first in ("gritd", "estimator", "drivers", "tools", "config", "tests")


def forbidden(path: Path) -> list[str]:
    return [
        m
        for m in imported(path)
        if ours(m) and not f"{m}.".startswith(tuple(f"{name}." for name in ALLOWED))
    ]


def test_no_file_imports_what_it_judges() -> None:
    assert FILES and not {str(path): forbidden(path) for path in FILES if forbidden(path)}


def test_the_walk_of_imports_sees_what_is_forbidden(tmp_path: Path) -> None:
    file = tmp_path / "cheat.py"
    file.write_text("from gritd.estimator.effects import library\n", encoding="utf-8")
    assert any(module.startswith("gritd.estimator.effects") for module in forbidden(file))


@pytest.mark.parametrize(
    "module",
    [
        "gritd.tools.proof.blind.plant.respond",
        "gritd.tools.proof.blind.plant.sensors",
        "gritd.tools.commands.prove",
    ],
)
def test_nothing_judged_is_loaded_by_way_of_others(module: str) -> None:
    code = f"import sys, {module}; print('\\n'.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded = done.stdout.split()
    assert module in loaded
    assert not [name for name in loaded if name.startswith(JUDGED)]
