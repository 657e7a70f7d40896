"""Folders that importers search."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.commands.import_rig import main


def test_a_folder_that_may_not_be_read_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is not an empty one. Root may read every folder, so another user is played."""

    def refused(path: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr(os, "scandir", refused)
    with pytest.raises(CommandError) as caught:
        main(["mgst", str(tmp_path), "-o", str(tmp_path / "out")])
    assert str(caught.value).startswith(f"{tmp_path}: cannot be read: Permission denied; expected")
    assert caught.value.code == 2 and "\n" not in str(caught.value)
