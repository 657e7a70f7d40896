"""The unit, the udev rules and the installation, as far as they can be checked without a booted
system.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time

import pytest

from gritd.tools.testbed import rig_config
from tests.scenarios.rig import ROOT, TESTBED, WIRES, DaemonProcess

UNIT = ROOT / "config" / "gritd.service"
VIEW = ROOT / "config" / "gritd-view.service"
CRASHES = "ten crashes in a minute"
CRASHING = """
import os, gritd.tools.service.serve as serving
serving.serve = lambda *_: os._exit(7)
"""
EXPOSURE = 2.5  # of systemd-analyze security; 0 is best, 10 worst

systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed"
)


def analyze(*arguments):
    return subprocess.run(
        ["systemd-analyze", *arguments], capture_output=True, text=True, check=False
    )


@systemd
@pytest.mark.parametrize("packaged", [UNIT, VIEW], ids=lambda path: path.name)
def test_the_unit_is_right(tmp_path, packaged):
    """With a program where the unit names one: nothing to complain about."""
    unit = tmp_path / packaged.name
    unit.write_text(packaged.read_text().replace("/opt/gritd/bin/gritd", sys.executable))
    done = analyze("verify", str(unit))
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 0)


@systemd
def test_the_unit_is_hardened(figure):
    done = analyze("security", "--offline=true", "--no-pager", str(UNIT))
    exposure = float(
        re.search(r"exposure level for gritd\.service: ([\d.]+)", done.stdout).group(1)
    )
    figure(
        "hardening of the unit", "systemd-analyze security", "exposure", exposure, "of 10", EXPOSURE
    )


@systemd
def test_the_unit_of_the_view_is_hardened():
    done = analyze("security", "--offline=true", "--no-pager", str(VIEW))
    assert float(re.search(r"exposure level for .*: ([\d.]+)", done.stdout).group(1)) <= EXPOSURE


KEYS = r"SUBSYSTEMS?|KERNEL|DRIVERS?|ACTION|ATTRS?\{\w+\}|ENV\{\w+\}|SYMLINK|GROUP|MODE|NAME"


def test_udev_rules_are_assignments_and_matches():
    """One rule a line, only keys that udev knows, every link below /dev/gritd."""
    lines = (ROOT / "config" / "90-gritd.rules").read_text().splitlines()
    pair = rf'({KEYS})(==|\+=|=)"[^"]*"'
    for line in (line for line in lines if line and line[0] != "#"):
        assert re.fullmatch(rf"{pair}(, {pair})*", line), line
        assert all(name.startswith("gritd/") for name in re.findall(r'SYMLINK\+="([^"]*)"', line))


def test_the_files_of_an_installation(tmp_path):
    """The program itself needs a package registry: it is left out here."""
    assert "kept" not in install("files", tmp_path)
    config = tmp_path / "etc" / "gritd" / "config.yaml"
    config.write_text("# mine\n")
    assert "kept" in install("files", tmp_path)
    assert config.read_text() == "# mine\n"
    assert "etc/systemd/system/gritd-view.service" in below(tmp_path)
    assert {"etc/systemd/system/gritd.service", "etc/udev/rules.d/90-gritd.rules"} <= below(
        tmp_path
    )
    assert {"usr/lib/sysusers.d/gritd.conf", "etc/gritd/testbed.dbc"} <= below(tmp_path)
    install("uninstall", tmp_path)
    assert below(tmp_path) == {"etc/gritd/config.yaml", "etc/gritd/testbed.dbc"}


def test_a_distribution_has_its_own_places(tmp_path):
    """PREFIX=/usr: only the configuration is outside /usr; the units name what is there."""
    install("files", tmp_path, PREFIX="/usr")
    outside = {path for path in below(tmp_path) if not path.startswith("usr/")}
    assert outside == {"etc/gritd/config.yaml", "etc/gritd/testbed.dbc"}
    for name in (UNIT.name, VIEW.name):
        unit = (tmp_path / "usr/lib/systemd/system" / name).read_text()
        assert "ExecStart=/usr/lib/gritd/bin/gritd " in unit and "/opt/" not in unit
        page = re.search(r"^Documentation=file:/(\S+)", unit, re.MULTILINE).group(1)
        assert (tmp_path / page).is_file()


@pytest.mark.parametrize(
    "home, warned", [("root/.pyenv", True), ("home/eva", True), ("usr", False)]
)
def test_an_interpreter_in_a_home_folder_is_warned_of(tmp_path, home, warned):
    python = tmp_path / "python3"
    python.write_text(f"#!/bin/sh\necho /{home}\n")
    python.chmod(0o755)
    done = subprocess.run(
        [str(ROOT / "tools" / "install"), "check"],
        env={"PYTHON": str(python), "PATH": "/usr/bin:/bin"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == "" and (f"the Python of /{home} cannot be used" in done.stderr) == warned
    assert ("PYTHON=/usr/bin/python3" in done.stderr) == warned


def test_crash_after_crash_backs_off(tmp_path, monkeypatch, figure):
    """A daemon that ends at once, started at once each time, as the unit does: never given up."""
    assert "StartLimitIntervalSec=0" in UNIT.read_text()
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    config, said, took = rig_config.write(TESTBED, {}, "linear", tmp_path), [], []
    for _ in range(8):
        began = time.monotonic()
        with DaemonProcess(config, prelude=CRASHING) as daemon:
            assert daemon.exit_code() == 7
            said.append([line for _, line in daemon.said if "ended again" in line])
        took.append(time.monotonic() - began)
    waits = [f"ended again and again: starts in {seconds} s" for seconds in (1, 2, 4)]
    assert said == [[]] * 5 + [[line] for line in waits]
    figure(CRASHES, WIRES, "starts at once", said.count([]), "", 5)
    assert took[7] > 4.0


def install(command, root, **more):
    environment = {"DESTDIR": str(root), "PATH": "/usr/bin:/bin", **more}
    script = str(ROOT / "tools" / "install")
    return subprocess.run(
        [script, command], env=environment, capture_output=True, text=True, check=True
    ).stdout


def below(root):
    return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}
