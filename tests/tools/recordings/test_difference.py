"""`gritd diff`: what two recordings were made with, compared by what it means."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import diff
from gritd.tools.recordings.difference import differences, same

Made = Callable[..., Path]
NAMELESS = RunInfo()


@pytest.fixture
def made(tmp_path: Path) -> Made:
    text = load(packaged()).text

    def make(name: str, run: RunInfo = NAMELESS, **changed: str) -> Path:
        yaml = text
        for before, after in changed.items():
            assert before.replace("_", " ") in yaml
            yaml = yaml.replace(before.replace("_", " "), after)
        path = tmp_path / f"{name}.mcap"
        RunWriter(path, [], yaml, run).close()
        return path

    return make


def found(a: Path, b: Path) -> dict[str, tuple[str, str, bool]]:
    return {
        each.key: (each.first, each.second, each.matters)
        for each in differences(diff.made(a), diff.made(b))
    }


def test_the_same_quantity_in_another_unit_is_no_difference(made: Made) -> None:
    assert found(made("a"), made("b", **{"72_mm": "0.072 m"})) == {}


def test_a_change_of_the_wheel_matters_and_one_of_a_name_does_not(made: Made) -> None:
    a = made("a", RunInfo(name="one", operator="Eva", nominal_load=40.0))
    b = made("b", RunInfo(name="two", operator="Ada", nominal_load=70.0), **{"72_mm": "75 mm"})
    keys = found(a, b)
    assert keys["wheel.radius"] == ("72 mm", "75 mm", True)
    assert keys["run.nominal_load"][2] and not keys["run.operator"][2]
    assert set(keys) == {"wheel.radius", "run.name", "run.operator", "run.nominal_load"}


def test_all_that_the_estimate_follows_is_said_to_matter(made: Made) -> None:
    changes = {"0.0958738": "0.0958", "2_mV": "3 mV", "gate:_5.0": "gate: 4.0", "50_ms": "60 ms"}
    a = made("a")
    for number, (before, after) in enumerate(changes.items()):
        b = made(f"b{number}", **{before: after})
        assert any(each[2] for each in found(a, b).values()), before


def test_it_is_told_in_lines_and_as_json(made: Made, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = made("a", RunInfo(notes="\x1b[2J")), made("b", **{"72_mm": "75 mm"})
    assert diff.main([str(a), str(b)]) == 0
    out = capsys.readouterr().out
    assert "wheel.radius" in out and "\x1b" not in out
    assert diff.main([str(a), str(b), "--json"]) == 0
    assert {each["key"] for each in json.loads(capsys.readouterr().out)} == {
        "wheel.radius",
        "run.notes",
    }
    assert diff.main([str(a), str(a)]) == 0 and capsys.readouterr().out.count("\n") == 1


@pytest.mark.parametrize("content, code", [(None, 2), (b"nothing of ours, and long enough", 3)])
def test_what_is_no_recording_is_refused(
    tmp_path: Path, made: Made, content: bytes | None, code: int
) -> None:
    other = tmp_path / "other.mcap"
    if content is not None:
        other.write_bytes(content)
    with pytest.raises(CommandError) as error:
        diff.main([str(made("a")), str(other)])
    assert error.value.code == code and str(other) in str(error.value)


@given(st.text(max_size=12), st.text(max_size=12))
def test_any_two_texts_can_be_compared(a: str, b: str) -> None:
    assert same(a, a) and same(a, b) == same(b, a)
