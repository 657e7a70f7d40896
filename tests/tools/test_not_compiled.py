"""Where there was no compiler, gritd says what that costs."""

from __future__ import annotations

import pytest

from gritd.estimator.compiled import arithmetic
from gritd.tools.commands import check_config, status
from tests.estimator.daemon.reports import REPORT


def test_check_config_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(arithmetic, "BUILT", False)
    assert check_config.main([]) == 0
    assert arithmetic.IN_PYTHON in capsys.readouterr().err


@pytest.mark.parametrize("arithmetic, said", [("compiled", False), ("in Python, slow", True)])
def test_status_says_so(arithmetic: str, said: bool) -> None:
    report = {**REPORT, "arithmetic": arithmetic}
    assert any(arithmetic in line for line in status.summary(report)) is said
