"""Packages with entry points: what they add is there by name, and one that is wrong is one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.plugin_package import READING, SENSOR, made, offer, python

pytestmark = pytest.mark.long


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder like site-packages with one distribution, my-rig."""
    return made(tmp_path)


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
        ("effects", "second = my_rig.ends", "ends the program"),
        ("effects", "second = my_rig.hangs", "takes more than"),
        ("importers", "other = my_rig.mylab", "found the name mylab"),
        ("importers", "mylab = my_rig.laser", "found no NAME"),
        ("importers", "badarg = my_rig.badarg", "add_arguments: KeyError"),
    ],
)
def test_one_that_is_wrong_is_named_with_its_package_and_left_out(
    package: Path, group: str, line: str, said: str
) -> None:
    offer(package, f"[gritd.{group}]\n{line}\n")
    command = ["effects"] if group == "effects" else ["import", "--help"]
    done = python(package, "-m", "gritd", *command)
    own = "bulldozing" if group == "effects" else "cmu"
    assert done.returncode == 0 and own in done.stdout
    assert done.stderr.startswith(f"gritd: plug-in {line.split()[0]} of gritd.{group}")
    assert "(package my-rig)" in done.stderr and said in done.stderr
    assert done.stderr.count("\n") == 1 and len(done.stderr) <= 300

    if group == "effects":
        assert python(package, "-m", "gritd", "check-config").returncode == 2


@pytest.mark.parametrize("module", ["ends", "laser:Nothing", "mylab"])
def test_a_sensor_that_is_wrong_ends_what_would_read_it(package: Path, module: str) -> None:
    offer(package, f"[gritd.sensors]\nsinkage_pot = my_rig.{module}\n")
    done = python(package, "-m", "gritd", "check-config")
    assert done.returncode == 2 and done.stdout == ""
    assert "(package my-rig)" in done.stderr and done.stderr.count("\n") == 1
    assert python(package, "-m", "gritd", "effects").stderr == ""


def test_what_an_importer_raises_or_ends_is_in_its_name(package: Path) -> None:
    offer(package, "[gritd.importers]\nfails = my_rig.fails\n")
    for word in ("raise", "exit"):
        done = python(package, "-m", "gritd", "import", "fails", word, "-o", "y")
        assert done.returncode == 2 and done.stderr.count("\n") == 1
        assert "plug-in fails of gritd.importers (package my-rig): " in done.stderr


def test_what_an_import_prints_is_told_and_does_not_reach_the_output(package: Path) -> None:
    offer(package, "[gritd.importers]\nmylab = my_rig.prints\n")
    done = python(package, "-m", "gritd", "import", "--help")
    assert "mylab" in done.stdout and "hello" not in done.stdout
    assert "(package my-rig): its import prints 'hello'" in done.stderr


@pytest.mark.parametrize("act", ["raise KeyError(1)", "return 'much'", "raise SystemExit(0)"])
def test_a_sensor_that_fails_is_named_and_the_others_of_its_device_go_on(
    package: Path, act: str
) -> None:
    (package / "my_rig" / "laser.py").write_text(
        SENSOR + f"\n    def value(self, frame):\n        {act}\n"
    )
    offer(package, "[gritd.sensors]\nsinkage_pot = my_rig.laser:Laser\n")
    read = python(package, "-c", READING).stdout.splitlines()
    assert read[0] == "motor_shunt" and len(read) == 2
    assert read[1].startswith("plug-in sinkage_pot of gritd.sensors (package my-rig): ")


def test_two_packages_of_one_name_are_refused_not_chosen_from(package: Path) -> None:
    offer(package, "[gritd.effects]\nsecond = my_rig.second:Second\n")
    other = package / "other_rig-1.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Name: other-rig\nVersion: 1\n")
    (other / "entry_points.txt").write_text("[gritd.effects]\nsecond = my_rig.second:Second\n")
    done = python(package, "-m", "gritd", "effects")
    said = "plug-in second of gritd.effects (package my-rig, other-rig): found it twice"
    assert "bulldozing" in done.stdout and said in done.stderr
