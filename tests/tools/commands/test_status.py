"""`gritd status`: the report of the running daemon in three forms, and the mistakes in a line."""

from __future__ import annotations

import json
import re

import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.commands import status
from tests.estimator.daemon.reports import REPORT, publishing


@pytest.fixture
def publisher(tmp_path):
    with publishing(tmp_path / "gritd.sock") as publisher:
        yield publisher


@pytest.mark.parametrize("form", [[], ["--json"], ["--prometheus"]])
def test_status_in_every_form(publisher, capsys, form):
    assert status.main(["--socket", str(publisher.path), *form]) == 0
    out = capsys.readouterr().out
    if form == ["--json"]:
        assert json.loads(out) == json.loads(json.dumps(REPORT))
    elif form:
        assert (
            "gritd_ticks_missed_total 2\n" in out
            and 'gritd_device_bad_total{device="a\\"b"} 3' in out
        )
        assert all(
            re.fullmatch(r'#.*|[a-z_]+(\{device=".*"\})? [-+.\de]+', line)
            for line in out.splitlines()
        )
    else:
        assert "STARTING" in out and "WAITING" in out


def test_status_of_a_daemon_that_hangs_is_code_1(publisher, monkeypatch):
    monkeypatch.setattr(
        publisher, "_report", lambda: {**REPORT, "healthy": False, "hanging": "loop"}
    )
    assert status.main(["--socket", str(publisher.path)]) == 1


def test_no_daemon_is_one_line(tmp_path):
    with pytest.raises(CommandError, match="no daemon answers: no such file or directory"):
        status.main(["--socket", str(tmp_path / "none")])
