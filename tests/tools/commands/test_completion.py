"""`gritd completion`: a shell completes commands, options and names."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from gritd.tools import main as cli
from gritd.tools.commands import completion


@pytest.fixture(scope="module")
def known():
    return completion.words()


def completed(script: str, *words: str) -> list[str]:
    """What bash offers for the last word."""
    line = " ".join(f"'{word}'" for word in words)
    place = f"COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}"
    asked = f"{script}\n{place}; _gritd; printf '%s\\n' ${{COMPREPLY[@]}}"
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes_commands_options_and_effects(known):
    script = completion.bash(known)
    assert completed(script, "gritd", "repl") == ["replay"]
    assert "--verify" in completed(script, "gritd", "replay", "--")
    assert completed(script, "gritd", "effects", "slip_s") == ["slip_sinkage"]


def test_every_command_is_in_every_script(known):
    for shell, script in completion.SCRIPTS.items():
        assert all(name in script(known) for name in cli.COMMANDS), shell
        assert "--config" in known["replay"] and "--verify" in script(known)
