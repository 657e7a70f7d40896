"""A rover computer without matplotlib: the daemon and all that reports in text or HTML work, and a
command that draws says in one line what it needs.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gritd.config import packaged
from tests.scenarios.rig import driven, service

pytestmark = pytest.mark.long

BLOCKED = "import sys; sys.modules['matplotlib'] = None"  # as if it were not installed
GRITD = f"{BLOCKED}; from gritd.tools.main import main; sys.exit(main(sys.argv[1:]))"
CONFIG = ("--config", str(packaged()))
SCHEDULE = """
ramp: 300 ms
segments:
  - {duration: 1.5 s, load: 45 N, slip: 0.1, speed: 0 mm/s}
  - {duration: 3 s, load: 45 N, slip: 0.15, speed: 20 mm/s}
  - {duration: 3 s, load: 45 N, slip: 0.3, speed: 20 mm/s}
"""


def gritd(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", GRITD, *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a simulated recording, run.mcap."""
    made = tmp_path_factory.mktemp("bare")
    (made / "schedule.yaml").write_text(SCHEDULE)
    done = gritd(made, "simulate", *CONFIG, "--schedule", "schedule.yaml", "-o", "run.mcap")
    assert done.returncode == 0, done.stderr
    return made


@pytest.mark.parametrize(
    "arguments",
    [
        ("check-config",),
        ("replay", "run.mcap"),
        ("recover", "run.mcap"),
        ("compare", "run.mcap", *CONFIG, "--report", "compared.html"),
        ("diagnose", "run.mcap", *CONFIG, "--json", "found.json", "--report", "found.html"),
        ("prove", "--help"),
        ("demo", "--help"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_what_draws_no_picture_works(folder: Path, arguments: tuple[str, ...]) -> None:
    done = gritd(folder, *arguments)

    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("command", ["status", "monitor"])
def test_the_daemons_watchers_work(folder: Path, command: str) -> None:
    done = gritd(folder, command, "--socket", folder / "none")

    assert done.returncode == 1
    assert done.stderr.endswith("no daemon answers: no such file or directory\n")


def test_what_draws_says_what_it_needs(folder: Path) -> None:
    done = gritd(folder, "compare", "run.mcap", *CONFIG, "--png", "sheet.png")

    assert done.returncode == 2
    assert done.stderr == (
        "gritd: --png: found no matplotlib; expected it installed: pip install matplotlib\n"
    )


def test_the_daemon_runs(tmp_path: Path) -> None:
    with service(tmp_path, driven(20.0, 1), prelude=BLOCKED) as (_, daemon):
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        daemon.stop()

    assert gritd(tmp_path, "replay", daemon.path(), "--verify").returncode == 0
