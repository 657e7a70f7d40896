"""`gritd` from outside: exit codes, one-line errors, the packaged configuration."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gritd.config import packaged
from gritd.drivers.errors import DeviceError, DeviceSettingsError
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.readings import ENCODERS
from gritd.tools import main as cli
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import check_config
from gritd.tools.dev import config_reference

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def testbed() -> Settings:
    return config.load(packaged()).settings


def gritd(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "gritd", *arguments], cwd=ROOT, capture_output=True, text=True
    )


def test_every_command_has_its_module() -> None:
    for module, summary in cli.COMMANDS.values():
        assert callable(importlib.import_module(module).main) and summary


def test_help_and_version() -> None:
    version, page = gritd("--version"), gritd("--help")
    assert version.returncode == page.returncode == 0 and version.stdout.startswith("gritd ")
    assert all(name in page.stdout for name in cli.COMMANDS)


def test_who_is_refused_by_the_lock_does_not_wait_for_numpy() -> None:
    code = (
        "import sys, gritd.tools.main, gritd.tools.commands.run; print(sorted({'numpy', 'can', "
        "'mcap'} & sys.modules.keys()))"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout
        == "[]\n"
    )


def test_what_listens_to_can_does_not_load_the_library_of_its_log_files(tmp_path: Path) -> None:
    """python-can takes asammdf, and with it pandas, wherever it is installed."""
    (tmp_path / "asammdf.py").write_text("raise SystemExit('asammdf is loaded')\n")
    script = (
        "import gritd.drivers.build, sys; print('can' in sys.modules, 'asammdf' in sys.modules)"
    )
    found = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert found.stdout == "True False\n", found.stderr


def test_digits_do_not_depend_on_the_number_of_cores() -> None:
    """Linear algebra on several threads adds in another order: one thread, unless the user says
    otherwise.
    """
    script = (
        "import os; from gritd.tools.main import main; main(['check-config']); "
        "print(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    bare = {name: value for name, value in os.environ.items() if "NUM_THREADS" not in name}
    for given, expected in ((bare, "1"), (bare | {"OPENBLAS_NUM_THREADS": "3"}, "3")):
        done = subprocess.run(
            [sys.executable, "-c", script], env=given, capture_output=True, text=True, check=True
        )
        assert done.stdout.split()[-1] == expected


def test_packaged_configuration_is_valid_and_summarised() -> None:
    run = gritd("check-config")
    assert (run.returncode, run.stderr) == (0, "")
    for words in (
        "valid",
        "r 72 mm, b 71 mm",
        "c 1000 ± 300 Pa",
        "WrenchForce+WrenchTorque",
        "slip",
    ):
        assert words in run.stdout


def test_effective_text_checks_too(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(
        gritd("check-config", "--effective").stdout, encoding="utf-8"
    )
    assert gritd("check-config", str(tmp_path / "rig.yaml")).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "gritd: expected a command"),
        (("dance",), "gritd: argument COMMAND: found no command 'dance'; expected"),
        (("check-config", "--dance"), "gritd: unrecognized arguments: --dance"),
        (
            ("check-config", "/nowhere.yaml"),
            "gritd: /nowhere.yaml: found no such file or directory; expected",
        ),
    ],
)
def test_usage_errors_are_one_line_and_code_2(arguments: Sequence[str], words: str) -> None:
    run = gritd(*arguments)
    assert run.returncode == 2 and run.stdout == ""
    assert run.stderr.startswith(words) and run.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("run", "--config", "x", "--load", "-5"),
            "gritd: argument --load: found '-5'; expected a number above 0 (see",
        ),
        (
            ("run", "--config", "x", "--load", "nan"),
            "gritd: argument --load: found 'nan'; expected a number above 0",
        ),
        (
            ("run", "--config", "x", "--pass", "0"),
            "gritd: argument --pass: found '0'; expected a whole number from 1",
        ),
        (
            ("run", "--config", "x", "--start", "inf"),
            "gritd: argument --start: found 'inf'; expected a number",
        ),
        (
            ("run", "--config", "x", "--status", "-1"),
            "gritd: argument --status: found '-1'; expected a number from 0",
        ),
        (
            ("reproduce", "--seed", "-1"),
            "gritd: argument --seed: found '-1'; expected a whole number from 0",
        ),
        (("reproduce", "--simulations", "0"), "gritd: argument --simulations: found '0'"),
    ],
)
def test_impossible_numbers_are_usage(
    arguments: Sequence[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    said = capsys.readouterr()
    assert (
        stop.value.code == 2
        and said.out == ""
        and said.err.startswith(words)
        and said.err.count("\n") == 1
    )


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("dbc: testbed.dbc", "dbc: other.dbc", "cannot read"),
        ("SinkagePot.Volts", "SinkagePot.Vults", "no signal SinkagePot.Vults"),
        ("MotorShunt.Volts", "Motor.Volts", "no message Motor "),
        ("interface: socketcan", "interface: pigeon", "no CAN interface 'pigeon'"),
        ("radius: 72 mm", "radius: 0 mm", "rig.yaml:8: wheel.radius: found 0 mm"),
    ],
)
def test_what_cannot_work_is_named(old: str, new: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "testbed.dbc").write_bytes(packaged("testbed.dbc").read_bytes())
    text = packaged().read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "rig.yaml").write_text(text.replace(old, new), encoding="utf-8")
    run = gritd("check-config", str(tmp_path / "rig.yaml"))
    assert run.returncode == 2 and run.stdout == ""
    assert run.stderr.startswith(f"gritd: {tmp_path}/rig.yaml:") and words in run.stderr
    assert run.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (
            CommandError("a.mcap: the last chunk is damaged", 3),
            3,
            "gritd: a.mcap: the last chunk is damaged\n",
        ),
        (CommandError("two\nlines"), 1, "gritd: two lines\n"),
        (DeviceError("bus", "gone"), 1, "gritd: bus: gone\n"),
        (DeviceSettingsError("device bus", "no dbc"), 2, "gritd: device bus: no dbc\n"),
        (
            config.ConfigError("a.yaml:1: x: found y; expected z"),
            2,
            "gritd: a.yaml:1: x: found y; expected z\n",
        ),
        (PermissionError(13, "Permission denied", "/x"), 1, "gritd: /x: permission denied\n"),
        (
            KeyError("x"),
            1,
            "gritd: internal error: KeyError: 'x' (GRITD_TRACEBACK=1 shows where)\n",
        ),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_errors_become_a_line_and_a_code(
    error: BaseException,
    code: int,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(_: Sequence[str]) -> int:
        raise error

    monkeypatch.setattr(importlib, "import_module", lambda name: SimpleNamespace(main=fail))
    assert cli.main(["check-config"]) == code
    assert capsys.readouterr().err == line


def test_reader_that_leaves_is_no_error() -> None:
    command = f"{sys.executable} -m gritd check-config | true; exit ${{PIPESTATUS[0]}}"
    run = subprocess.run(["bash", "-c", command], cwd=ROOT, capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (0, "")


def test_a_terminal_without_greek_letters_gets_question_marks() -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "gritd", "check-config"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert (run.returncode, run.stderr) == (0, "") and "tan ?" in run.stdout


def test_reference_is_current() -> None:
    text = config_reference.PAGE.read_text(encoding="utf-8")
    wanted = (
        text.partition(config_reference.BEGIN)[0]
        + config_reference.BEGIN
        + config_reference.reference()
    )
    assert text == wanted, "run: python -m gritd.tools.dev.config_reference"


def test_slip_resolution_is_what_a_simulated_window_shows(testbed: Settings) -> None:
    """The stated resolution against slopes fitted to noisy counts."""
    random = np.random.default_rng(7)
    noisy = {name: replace(testbed.channels[name], noise=0.5) for name in ENCODERS}
    testbed = replace(testbed, channels={**testbed.channels, **noisy})
    count = check_config.window_readings(testbed)
    times = np.arange(count) / testbed.rates.tick
    speeds = []

    for name, radius, speed in zip(
        ENCODERS, (testbed.wheel.radius, testbed.pulley_radius), (0.02, 0.016), strict=True
    ):
        per_count = noisy[name].calibration.scale.value * radius
        counts = speed / per_count * times + random.normal(0, 0.5, (4000, count))
        speeds.append(np.polyfit(times, (counts * per_count).T, 1)[0])

    assert np.std(1 - speeds[1] / speeds[0]) == pytest.approx(
        check_config.slip_sigma(testbed), rel=0.05
    )


def test_a_closed_standard_output_is_no_error():
    command = f"exec {sys.executable} -m gritd check-config config/testbed.yaml >&-"
    done = subprocess.run(
        ["sh", "-c", command], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
