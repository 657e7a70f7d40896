"""The configuration: what is refused, and in which words."""

from __future__ import annotations

import re
import time
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from tests.estimator.config.rig import HOSTILE, MINIMAL, message

TESTBED = packaged().read_text(encoding="utf-8")


def test_a_file_that_marks_its_beginning_marks_its_end() -> None:
    assert config.loads(f"# mine\n---\n{MINIMAL}...\n# done\n", "rig.yaml").ended


def test_a_file_by_hand_needs_its_end_for_a_reload_only(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(MINIMAL)
    assert not config.load(path).ended
    with pytest.raises(ConfigError, match=r":20: document: found no end; expected '\.\.\.' as"):
        config.reload(path)
    path.write_text(MINIMAL + "...\n")
    assert config.reload(path) == config.load(path)


def test_an_end_inside_a_value_is_none() -> None:
    text = MINIMAL + 'run: {notes: "... and so on"}\n'
    assert not config.loads(text, "rig.yaml").ended


@pytest.mark.parametrize("text", ["", "\n# nothing\n", "hello", "[1, 2]", "3", "null", "{}"])
def test_not_a_configuration(text: str) -> None:
    assert message(text).startswith("rig.yaml:1: ")


@pytest.mark.parametrize(
    "content",
    [b"\xff\xfe\x00", b"a: \x80", b"\x00", b"x" * 300_000, b"a: 1\n" * 60_000],
    ids=["utf16", "not utf8", "nul", "long", "many lines"],
)
def test_files_that_are_no_text(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(content)
    with pytest.raises(
        ConfigError, match=r"^[^\n]*rig\.yaml[^\n]*: found [^\n]+; expected [^\n]+$"
    ):
        config.load(path)


def test_file_above_the_limit_is_called_so(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(
        "##" + "é" * 200_000, encoding="utf-8"
    )  # the limit falls inside a character
    with pytest.raises(ConfigError, match=r"rig\.yaml: found more than 256 KiB"):
        config.load(tmp_path / "rig.yaml")


def test_missing_file_folder_and_endless_device(tmp_path: Path) -> None:
    for path in (tmp_path / "none.yaml", tmp_path, Path("/dev/zero"), tmp_path / "a\0b"):
        with pytest.raises(ConfigError, match="expected a configuration file"):
            config.load(path)
    with pytest.raises(ConfigError, match="found a directory; expected a configuration file"):
        config.load(tmp_path)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_takes_little_memory_and_time(name: str) -> None:
    """20 ms of processor time at most, measured; what grows with a power takes minutes."""
    text, words = HOSTILE[name]
    start = time.thread_time()
    message(text)
    seconds = time.thread_time() - start

    tracemalloc.start()
    line = message(text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert words in line and peak < 16e6 and seconds < 2.0


@settings(max_examples=150)
@given(st.data())
def test_a_damaged_file_is_read_or_refused_in_one_line(data: st.DataObject) -> None:
    """Any edit of a good file ends in settings or in a ConfigError of one line, never in another
    exception.
    """
    text = MINIMAL
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(text)))
        cut = data.draw(st.integers(0, 6))
        text = text[:at] + data.draw(st.text(max_size=6)) + text[at + cut :]
    try:
        config.loads(text, "rig.yaml")
    except ConfigError as error:
        assert re.fullmatch(r"rig\.yaml:\d+: .+: found .+; expected .+", str(error))
