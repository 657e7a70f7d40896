"""`gritd example`: a campaign to try the other commands on, the same every time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gritd
from gritd.tools import main as cli


def test_it_is_the_same_every_time_and_takes_no_file_s_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("one", "two"):
        assert (
            cli.main(["example", str(tmp_path / name), "--effect", "slip_sinkage.growth=0.2"]) == 0
        )
    first, second = (gritd.read(tmp_path / name / "run-070N.mcap") for name in ("one", "two"))
    assert np.array_equal(first["raw/motor_shunt"], second["raw/motor_shunt"])

    assert cli.main(["example", str(tmp_path / "one")]) == 2
    assert "is there already" in capsys.readouterr().err
    assert cli.main(["example", str(tmp_path / "three"), "--effect", "nothing.gain=1"]) == 2
    assert not (tmp_path / "three").exists()
