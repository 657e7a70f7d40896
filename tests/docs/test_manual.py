"""The manual has every command with its options, and `man` reads it without a warning."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from gritd.tools.commands.table import COMMANDS
from gritd.tools.dev.manual.examples import EXAMPLES
from gritd.tools.dev.manual.page import pages
from gritd.tools.dev.manual.roff import man_pages


@pytest.fixture(scope="module")
def manual() -> dict[str, str]:
    return man_pages(pages())


def test_every_command_has_a_page_and_an_example(manual: dict[str, str]) -> None:
    assert sorted(manual) == sorted(["gritd.1", *(f"gritd-{name}.1" for name in COMMANDS)])
    assert set(EXAMPLES) == set(COMMANDS)
    assert all(f"gritd {name}" in " ".join(EXAMPLES[name].lines) for name in COMMANDS)


def test_a_page_has_the_options_of_subcommands_too(manual: dict[str, str]) -> None:
    assert r"\-\-config" in manual["gritd-replay.1"]
    assert r"\-\-known" in manual["gritd-calibrate.1"]


@pytest.mark.skipif(shutil.which("man") is None, reason="no man here")
def test_man_reads_them_without_a_warning(manual: dict[str, str], tmp_path: Path) -> None:
    for name, text in manual.items():
        (tmp_path / name).write_text(text, encoding="utf-8")

    command = ["man", "--warnings", "--local-file", *(str(tmp_path / name) for name in manual)]
    plain = {"LC_ALL": "C.UTF-8", "MANPAGER": "cat", "PATH": "/usr/bin:/bin"}
    done = subprocess.run(command, env=plain, capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert "gritd-run - " in done.stdout and "tan φ" in done.stdout
