"""Where a command may write is found out before it works."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.cli.files import open_to_all, vacant, writable


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("none/x", "found no folder"),
        ("file/x", "found no folder"),
        (".", "found a folder"),
        ("/proc/x", "may not write into /proc"),
    ],
)
def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path, name: str, line: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(CommandError, match=line) as error:
        writable(tmp_path / name)
    assert "\n" not in str(error.value) and "expected" in str(error.value)
    assert error.value.code == USAGE
    if line != "found a folder":
        with pytest.raises(CommandError, match=line):
            vacant(tmp_path / name)


def test_a_file_or_a_folder_of_others_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "theirs").touch()
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write everywhere
    with pytest.raises(CommandError, match="theirs: may not be written") as error:
        writable(tmp_path / "theirs")
    assert error.value.code == USAGE


def test_a_check_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "old").write_bytes(b"mine")
    for name in ("new", "old"):
        assert writable(tmp_path / name, replaced=True) == tmp_path / name
    assert writable(Path("/dev/stdout")) == Path("/dev/stdout")
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    assert (tmp_path / "old").read_bytes() == b"mine"


@pytest.mark.parametrize("writable_one", ["testbed.yaml", "testbed.dbc", None])
def test_a_trusted_file_that_anybody_may_change_is_told(
    tmp_path: Path, writable_one: str | None
) -> None:
    for name in ("testbed.yaml", "testbed.dbc"):
        (tmp_path / name).write_bytes(packaged(name).read_bytes())
        (tmp_path / name).chmod(0o666 if name == writable_one else 0o644)
    source = tmp_path / "testbed.yaml"
    reported = open_to_all(source, load(source).settings)
    assert [line.partition(":")[0] for line in reported] == [
        str(tmp_path / name) for name in (writable_one,) if name
    ]
