"""Which campaigns of a batch alarm."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.tools.dev.alarms import main
from gritd.tools.proof.blind import trial
from gritd.tools.proof.blind.strata import Assignment
from gritd.tools.proof.blind.trial import Spec


def test_quiet_and_loud_cases_are_counted_by_their_kind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = (("runs", 2), ("wrench", False))
    kinds = (
        Assignment("none", without=few),
        Assignment("single", ("gear_ripple",), "strong", without=few),
    )
    for number, kind in enumerate(kinds, start=1):
        trial.prepare(Spec(number, 40 + number, kind, str(tmp_path), keep=True))

    main([str(tmp_path)])
    first, second, *counted = capsys.readouterr().out.splitlines()
    assert first.startswith("case-0001 none (nothing): quiet")
    assert second.startswith("case-0002 single strong (gear_ripple): alarm")
    assert counted == ["none: 0 of 1 alarm", "single strong: 1 of 1 alarm"]

    main([str(tmp_path), "--level", "strong"])
    assert capsys.readouterr().out.splitlines()[1:] == ["single strong: 1 of 1 alarm"]
