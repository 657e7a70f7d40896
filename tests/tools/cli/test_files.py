"""Where a command may write is found out before it works."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.cli.files import vacant, writable


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
