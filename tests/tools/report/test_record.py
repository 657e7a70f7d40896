"""A diagnosis is done again from its JSON or its report, on the same files only, and compared."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.commands.diagnose import main
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.rig.signals import sha256
from gritd.tools.report import diagnosis, record
from tests.tools.report import cases


@pytest.fixture
def found(tmp_path: Path) -> Diagnosis:
    """A result that names a recording of this folder."""
    recording = tmp_path / "a <run> & more.mcap"
    recording.write_bytes(b"readings")
    needed = {
        "files": {str(recording): sha256(recording)},
        "configuration": "wheel: <r> & 'b'\n",
        "seed": 7,
    }
    return replace(
        cases.explained(),
        redo={**needed, "versions": {"numpy": "0.1"}, "command": "gritd diagnose …"},
    )


def saved(found: Diagnosis, folder: Path, form: str) -> Path:
    path = folder / f"diagnosis.{form}"
    if form == "html":
        diagnosis.write(found, path)
    else:
        path.write_text(json.dumps(found.to_json()), encoding="utf-8")
    return path


@pytest.mark.parametrize("form", ["json", "html"])
def test_json_and_report_hold_all_it_takes(found: Diagnosis, tmp_path: Path, form: str) -> None:
    kept = record.read(saved(found, tmp_path, form))
    assert kept == replace(record.Record.of(found), folder=tmp_path)
    assert kept.configuration == "wheel: <r> & 'b'\n" and kept.seed == 7
    assert kept.accepted == ("coulomb_friction",)
    record.check(kept)
    assert any(
        line.startswith("numpy ") and line.endswith("then 0.1")
        for line in record.changed_versions(kept)
    )


def test_the_files_may_have_moved_with_the_report(found: Diagnosis, tmp_path: Path) -> None:
    name = "run.mcap"
    moved = replace(found, redo={**found.redo, "files": {name: "0" * 64}})
    assert list(record.read(saved(moved, tmp_path, "json")).files) == [tmp_path / name]


@pytest.mark.parametrize("how", ["absolute", "relative", "link"])
def test_a_file_outside_the_reports_folder_is_not_looked_at(
    found: Diagnosis, tmp_path: Path, how: str
) -> None:
    """A report that somebody sent must not tell him of the reader's other files."""
    secret, folder = tmp_path / "secret", tmp_path / "sent"
    secret.write_bytes(b"secret")
    folder.mkdir()
    name = {"absolute": str(secret), "relative": "../secret", "link": "link"}[how]
    (folder / "link").symlink_to(secret)
    path = saved(replace(found, redo={**found.redo, "files": {name: "0" * 64}}), folder, "json")
    with pytest.raises(CommandError, match="found no such file there") as error:
        main(["--redo", str(path)])
    assert error.value.code == USAGE and sha256(secret)[:8] not in str(error.value)


def test_the_recordings_may_lie_elsewhere_if_the_user_says_so(
    found: Diagnosis, tmp_path: Path
) -> None:
    folder = tmp_path / "reports"
    folder.mkdir()
    kept = record.read(saved(found, folder, "json"), data=tmp_path)
    record.check(kept)


def test_another_file_is_refused_in_one_line(found: Diagnosis, tmp_path: Path) -> None:
    path = saved(found, tmp_path, "html")
    next(iter(record.read(path).files)).write_bytes(b"others")
    with pytest.raises(CommandError) as error:
        main(["--redo", str(path)])
    assert "more.mcap: found another file" in str(error.value) and error.value.code == DAMAGED
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "[]", '{"redo": 3}', "<html></html>", "[" * 100_000])
def test_what_is_no_diagnosis_is_reported(tmp_path: Path, text: str) -> None:
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(
        CommandError, match="found no diagnosis; expected the JSON or the report"
    ) as error:
        record.read(path)
    assert error.value.code == USAGE


def test_differences_are_named(found: Diagnosis) -> None:
    then = record.Record.of(found)
    assert not list(record.differences(then, then))

    now = replace(
        then,
        verdict="unlisted",
        accepted=(),
        probability={**then.probability, "coulomb_friction": 0.2},
    )
    assert list(record.differences(then, now)) == [
        "verdict unlisted, then explained",
        "accepted no effect, then coulomb_friction",
        "coulomb_friction 0.20 probable, then 0.86",
    ]


def test_usage() -> None:
    for arguments in (
        [],
        ["run.mcap"],
        ["--redo", "d.json", "run.mcap"],
        ["--redo", "d.json", "--seed", "1"],
    ):
        with pytest.raises(CommandError, match="expected") as error:
            main(arguments)
        assert error.value.code == USAGE
