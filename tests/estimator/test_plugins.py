"""Packages with entry points: what they add is there by name, and one that is wrong is one line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EFFECT = '''
from dataclasses import dataclass

from gritd.estimator.effects.base import Effect
from gritd.estimator.effects.bulldozing import Bulldozing


@dataclass(frozen=True)
class Second(Bulldozing, Effect):
    """Soil pushed ahead, once more."""
'''
IMPORTER = """
NAME, SUMMARY = "mylab", "the logs of my own laboratory, as its program writes them"


def add_arguments(parser):
    parser.add_argument("--fast", action="store_true")


def run(args, tell):
    tell(f"mylab was here, {args.fast}")
    return []
"""
SENSOR = '''
from gritd.drivers.sensor import Analog


class Laser(Analog):
    """Volts of a laser."""

    channel = "sinkage_pot"
'''


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder like site-packages with one distribution, my-rig."""
    (tmp_path / "my_rig").mkdir()
    files = {"__init__": "", "second": EFFECT, "mylab": IMPORTER, "laser": SENSOR}
    for name, text in files.items():
        (tmp_path / "my_rig" / f"{name}.py").write_text(text)
    (tmp_path / "my_rig-1.dist-info").mkdir()
    (tmp_path / "my_rig-1.dist-info" / "METADATA").write_text("Name: my-rig\nVersion: 1\n")
    return tmp_path


def offer(package: Path, text: str) -> None:
    (package / "my_rig-1.dist-info" / "entry_points.txt").write_text(text)


def python(package: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(package), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )


def test_all_three_are_found(package: Path) -> None:
    offer(
        package,
        "[gritd.effects]\nsecond = my_rig.second:Second\n"
        "[gritd.importers]\nmylab = my_rig.mylab\n"
        "[gritd.sensors]\nsinkage_pot = my_rig.laser:Laser\n",
    )
    code = (
        "from gritd.estimator.effects import EFFECTS, make\n"
        "from gritd.drivers.sensor import sensor_kinds\n"
        "print(make('second', {}).name, 'bulldozing' in EFFECTS, "
        "sensor_kinds()['sinkage_pot'].__name__, len(sensor_kinds()))"
    )
    assert python(package, "-c", code).stdout.split() == ["second", "True", "Laser", "6"]

    done = python(package, "-m", "gritd", "import", "mylab", "x", "-o", "y", "--fast")
    assert done.returncode == 0 and done.stdout == "mylab was here, True\n"
    assert "second" in python(package, "-m", "gritd", "effects").stdout


@pytest.mark.parametrize(
    ("group", "line", "said"),
    [
        ("effects", "third = my_rig.nowhere:X", "cannot be loaded: ModuleNotFoundError"),
        ("effects", "third = my_rig.second:Second", "found the effect second; expected third"),
        ("effects", "second = my_rig.mylab", "found no subclass of Effect"),
        ("importers", "other = my_rig.mylab", "found the name mylab"),
        ("importers", "mylab = my_rig.laser", "found no NAME"),
        ("sensors", "wrench = my_rig.laser:Laser", "found the channel sinkage_pot"),
    ],
)
def test_one_that_is_wrong_is_one_line_with_its_package(
    package: Path, group: str, line: str, said: str
) -> None:
    offer(package, f"[gritd.{group}]\n{line}\n")
    command = {"effects": ["effects"], "importers": ["import"], "sensors": ["check-config"]}
    done = python(package, "-m", "gritd", *command[group])
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(f"gritd: plug-in {line.split()[0]} of gritd.{group}")
    assert "(package my-rig)" in done.stderr and said in done.stderr
    assert done.stderr.count("\n") == 1


def test_two_packages_of_one_name_are_refused_not_chosen_from(package: Path) -> None:
    offer(package, "[gritd.effects]\nsecond = my_rig.second:Second\n")
    other = package / "other_rig-1.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Name: other-rig\nVersion: 1\n")
    (other / "entry_points.txt").write_text("[gritd.effects]\nsecond = my_rig.second:Second\n")
    done = python(package, "-m", "gritd", "effects")
    said = "plug-in second of gritd.effects (package my-rig, other-rig): found it twice"
    assert done.returncode == 2 and said in done.stderr
