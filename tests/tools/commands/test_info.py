"""`gritd info`: what a recording holds, gaps and damage included."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools import main as cli


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Two seconds of a potentiometer at 100 Hz, silent from 0.5 s to 1.2 s."""
    path = tmp_path / "run.mcap"
    text = packaged().read_text(encoding="utf-8")
    writer = RunWriter(path, (), text, RunInfo("sand", 70.0, notes="raked twice", operator="Ada"))
    for place in range(200):
        if not 50 < place < 120:
            stamp = 10 * NS + place * NS // 100
            writer.reading(Reading(stamp, "sinkage_pot", 1.0, stamp))
    writer.close()
    return path


def test_run_rate_gap_and_configuration_are_told(recorded, capsys):
    assert cli.main(["info", str(recorded)]) == 0
    said = capsys.readouterr().out
    assert "sand, load 70 N, pass 1" in said and "raked twice" in said
    assert "operator       Ada" in said
    assert "single-wheel testbed: wheel r 72 mm, b 71 mm" in said
    (line,) = [line for line in said.splitlines() if line.startswith("/raw/sinkage_pot")]
    assert line.split() == [
        "/raw/sinkage_pot",
        "131",
        "100",
        "Hz",
        "1",
        "700",
        "ms",
        "from",
        "0.5",
        "s",
    ]
    assert "closed and whole" in said


def test_a_damaged_recording_is_told_with_code_3(recorded, capsys):
    data = bytearray(recorded.read_bytes())
    data[data.index(b"\x28\xb5\x2f\xfd") + 30] ^= 1  # inside a zstd frame
    recorded.write_bytes(data)
    assert cli.main(["info", str(recorded)]) == 3
    assert "damage         run.mcap: " in capsys.readouterr().out


def test_missing_file_and_folder(tmp_path, capsys):
    assert cli.main(["info", str(tmp_path / "none.mcap")]) == 2
    assert cli.main(["info", str(tmp_path)]) == 3
    assert capsys.readouterr().err.count("\n") == 2
