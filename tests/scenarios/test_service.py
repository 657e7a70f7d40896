"""The unit, the udev rules and the installation, as far as they can be checked without a booted
system.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

import pytest

from tests.scenarios.rig import ROOT

UNIT = ROOT / "config" / "gritd.service"
EXPOSURE = 2.5  # of systemd-analyze security; 0 is best, 10 worst

systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed"
)


def analyze(*arguments):
    return subprocess.run(
        ["systemd-analyze", *arguments], capture_output=True, text=True, check=False
    )


@systemd
def test_the_unit_is_right(tmp_path):
    """With a program where the unit names one: nothing to complain about."""
    unit = tmp_path / "gritd.service"
    unit.write_text(UNIT.read_text().replace("/opt/gritd/bin/gritd", sys.executable))
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
    assert {"etc/systemd/system/gritd.service", "etc/udev/rules.d/90-gritd.rules"} <= below(
        tmp_path
    )
    assert {"usr/lib/sysusers.d/gritd.conf", "etc/gritd/testbed.dbc"} <= below(tmp_path)
    install("uninstall", tmp_path)
    assert below(tmp_path) == {"etc/gritd/config.yaml", "etc/gritd/testbed.dbc"}


def install(command, root):
    environment = {"DESTDIR": str(root), "PATH": "/usr/bin:/bin"}
    script = str(ROOT / "tools" / "install")
    return subprocess.run(
        [script, command], env=environment, capture_output=True, text=True, check=True
    ).stdout


def below(root):
    return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}
