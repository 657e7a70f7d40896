"""A folder of recordings: drafts of killed daemons, the cap on what they take."""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import McapFile, RecordingError
from gritd.estimator.recording.retention import sweep, trim
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.writer import WriterThread


def test_what_a_killed_daemon_had_only_begun_is_swept_away(tmp_path):
    for name in (".a.mcap.new", "a.mcap", ".gritd.lock", "b.new"):
        (tmp_path / name).touch()
    sweep(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".gritd.lock", "a.mcap", "b.new"]


def test_a_recording_whose_name_a_power_cut_took_back_gets_it_again(tmp_path):
    """The folder may reach the medium later than the file: simulated by renaming a recording to its
    draft.
    """
    path = tmp_path / "a.mcap"
    thread = WriterThread(path, [], "a: 1\n", RunInfo("a"))
    thread.put([Reading(10**18 + i, "wheel_encoder", i, 10**18 + i) for i in range(10)])
    thread.stop()
    path.rename(tmp_path / ".a.mcap.new")
    assert sweep(tmp_path) == [path]
    assert read(path).arrays("/raw/wheel_encoder")["count"].tolist() == list(range(10))


def test_the_oldest_closed_recordings_go_first(tmp_path):
    paths = [tmp_path / f"{n}.mcap" for n in range(5)]
    for age, path in enumerate(paths):
        path.write_bytes(bytes(1000))
        os.utime(path, (1000 - age, 1000 - age))  # the last is the oldest
    (tmp_path / "notes.txt").write_bytes(bytes(10_000))
    assert list(trim(tmp_path, 3000, [paths[4]])) == [paths[3], paths[2]]
    assert list(trim(tmp_path, 0, [paths[4]])) == [paths[1], paths[0]]
    assert paths[4].exists() and (tmp_path / "notes.txt").exists()
    assert list(trim(tmp_path, math.inf, [])) == []


def test_the_cap_holds_beside_links_and_folders_named_like_recordings(tmp_path):
    """Whatever lies in the folder under a recording's name: what is a file goes, and only that."""
    outside = tmp_path / "outside"
    outside.write_bytes(bytes(5000))
    folder = tmp_path / "logs"
    folder.mkdir()
    (folder / "0.mcap").symlink_to(tmp_path / "nothing")
    (folder / "1.mcap").symlink_to(outside)
    (folder / "2.mcap").mkdir()
    os.mkfifo(folder / "3.mcap")
    (folder / "4.mcap").write_bytes(bytes(1000))
    assert list(trim(folder, 500, [])) == [folder / "4.mcap"]
    assert outside.exists() and (folder / "1.mcap").is_symlink()


def test_a_recording_that_cannot_be_deleted_does_not_keep_the_others(tmp_path, monkeypatch):
    for n in range(3):
        (tmp_path / f"{n}.mcap").write_bytes(bytes(1000))
        os.utime(tmp_path / f"{n}.mcap", (n, n))
    unlink = Path.unlink

    def refusing(path, missing_ok=False):
        if path.name == "0.mcap":
            raise PermissionError(1, "not permitted", str(path))
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", refusing)
    deleted = []
    with pytest.raises(PermissionError):
        deleted.extend(trim(tmp_path, 0, []))
    assert not (tmp_path / "1.mcap").exists() and not (tmp_path / "2.mcap").exists()


def test_what_is_no_draft_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / ".run.mcap.new")
    assert sweep(tmp_path) == []
    with pytest.raises(RecordingError, match=r"create: \.run\.mcap\.new is there and is no"):
        McapFile(tmp_path / "run.mcap")
    assert not (tmp_path / "run.mcap").exists()
