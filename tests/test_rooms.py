"""Imports point one way: from tools to the estimator, and within tools from the commands to what
all of them share. A room that imports one above it, or beside it, would make a circle.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]

# the lowest first; a room imports itself and those of lower rows
ROOMS = (
    ("config", "estimator.compiled", "estimator.visible", "estimator.plugins"),
    ("estimator.terramechanics", "estimator.messages", "estimator.threads"),
    ("estimator.stages",),
    ("estimator.effects",),
    ("estimator.model",),
    ("estimator.config",),
    ("estimator.limits",),
    ("estimator.recording",),
    ("estimator.wheel",),
    ("estimator.filter",),
    ("estimator.online",),
    ("estimator.offline", "estimator.daemon"),
    ("estimator.plausibility",),
    ("drivers",),
    ("tools.cli",),
    ("tools.messages",),
    (
        "tools.testbed",
        "tools.service",
        "tools.diagnose",
        "tools.importers",
        "tools.paper",
        "tools.calibrate",
        "tools.recordings",
    ),
    ("tools.bench", "tools.report", "tools.view"),
    ("tools.proof",),
    ("tools.commands",),
    ("tools.main", "tools.dev"),
)
DIAGNOSIS = (
    *("tuning", "orders", "rig", "noise", "fit"),
    *("screen", "search", "verdict", "explain", "method"),
)  # in the order of the method
HEIGHT = {room: height for height, row in enumerate(ROOMS) for room in row}
FILES = sorted(
    path.relative_to(ROOT)
    for part in ("config", "estimator", "drivers", "tools")
    for path in (ROOT / part).rglob("*.py")
)


def room_of(module: str) -> str:
    """The room of a module's name without `gritd.`."""
    parts = module.split(".")
    return ".".join(parts[: 2 if parts[0] in ("estimator", "tools") else 1])


def imported(path: Path) -> Iterator[str]:
    """Modules of gritd that a file imports, without `gritd.`; also those it names as text, as the
    table of commands does.
    """
    for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names = [node.value]
        else:
            continue
        yield from (name.removeprefix("gritd.") for name in names if name.startswith("gritd."))


def test_every_file_has_a_room() -> None:
    rooms = {room_of(".".join(path.with_suffix("").parts)) for path in FILES}
    assert rooms - {"estimator.__init__", "tools.__init__"} == set(HEIGHT)


def test_imports_point_down() -> None:
    wrong = []
    for path in FILES:
        here = room_of(".".join(path.with_suffix("").parts))
        others = [(room_of(module), module) for module in imported(path)]
        wrong += [
            f"{path} imports {module}"
            for room, module in others
            if room in HEIGHT and room != here and HEIGHT[room] >= HEIGHT[here]
        ]

    assert wrong == []


def test_rooms_of_the_diagnosis_import_earlier_ones() -> None:
    place = {f"tools.diagnose.{room}": number for number, room in enumerate(DIAGNOSIS)}
    wrong = []
    for path in (p for p in FILES if p.parts[:2] == ("tools", "diagnose") and len(p.parts) > 2):
        here = ".".join(path.with_suffix("").parts[:3])
        if here == "tools.diagnose.__init__":
            continue
        others = {".".join(module.split(".")[:3]) for module in imported(path)} & set(place)
        wrong += [f"{path} imports {room}" for room in others if place[room] > place[here]]

    assert wrong == []


# what a rig offers, and its used values as one vector
INTERFACE = ("tools.diagnose.rig.interface.", "tools.diagnose.rig.stack.")


def test_rooms_of_the_diagnosis_know_a_rig_by_its_interface() -> None:
    rooms = DIAGNOSIS[DIAGNOSIS.index("rig") + 1 :]
    wrong = [
        f"{path} imports {module}"
        for path in FILES
        if path.parts[:2] == ("tools", "diagnose") and path.with_suffix("").parts[2] in rooms
        for module in imported(path)
        if module.startswith("tools.diagnose.rig.") and not module.startswith(INTERFACE)
    ]
    assert wrong == []


def test_drivers_know_messages_configuration_and_threads_of_the_estimator() -> None:
    allowed = {
        "estimator.config",
        "estimator.messages",
        "estimator.plugins",
        "estimator.threads",
    }
    rooms = {
        room_of(module)
        for path in FILES
        if path.parts[0] == "drivers"
        for module in imported(path)
        if module.startswith("estimator")
    }
    assert rooms <= allowed


def test_an_init_file_hands_names_on_and_no_more() -> None:
    for path in FILES:
        if path.name != "__init__.py":
            continue
        for node in ast.parse((ROOT / path).read_text(encoding="utf-8")).body:
            text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            names = isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
            assert text or names or isinstance(node, (ast.Import, ast.ImportFrom)), path


def test_no_file_of_tests_is_imported_by_another() -> None:
    """What several share stands in a module of its own. The page on adding an effect says that the
    tests of the folder run on it, so they are run there.
    """
    runs_them = {"tests/estimator/effects/test_adding_an_effect.py"}
    imports = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "tests").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("tests")
        for name in node.names
        if any(part.startswith("test_") for part in [*node.module.split("."), name.name])
    }
    assert imports == runs_them
