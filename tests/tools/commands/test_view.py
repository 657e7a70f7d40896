"""`gritd view`: what it refuses, in a line."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

pytest.importorskip("uvicorn", reason="needs gritd[view]")
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import view
from gritd.tools.view import library


def refused(*options: str) -> CommandError:
    with pytest.raises(CommandError) as error:
        view.main(options)
    assert len(str(error.value)) <= 300 and "\n" not in str(error.value)
    return error.value


def test_beyond_this_computer_a_token_is_asked_for() -> None:
    error = refused("--host", "0.0.0.0")
    assert error.code == 2 and "--token-file" in str(error)


@pytest.mark.parametrize("content", ["", "short\n", "\n0123456789abcdef\n"])
def test_a_token_is_the_first_line_and_long_enough(tmp_path: Path, content: str) -> None:
    file = tmp_path / "token"
    file.write_text(content)
    error = refused("--host", "0.0.0.0", "--token-file", str(file))
    assert error.code == 2 and str(file) in str(error)
    assert refused("--token-file", str(tmp_path / "none")).code == 2


def test_a_port_that_is_taken_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        error = refused("--port", port)
    assert error.code == 1 and port in str(error)


def test_an_address_that_is_not_ours_is_refused(tmp_path: Path) -> None:
    token = tmp_path / "token"
    token.write_text("0123456789abcdef\n")
    error = refused("--host", "192.0.2.1", "--token-file", str(token))
    assert error.code == 2 and "192.0.2.1" in str(error)


def test_without_the_extra_the_line_to_install_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "PACKAGE", "metaflow-card-uplot")
    monkeypatch.setattr(library.metadata, "files", lambda name: None)
    error = refused("--port", "0")
    assert error.code == 2 and "gritd[view]" in str(error)


def test_foxglove_is_served_the_daemon_on_this_computer_alone(tmp_path: Path) -> None:
    token = tmp_path / "token"
    token.write_text("0123456789abcdef\n")
    beyond = ("--host", "0.0.0.0", "--token-file", str(token), "--foxglove")
    for options in (beyond, (str(tmp_path / "run.mcap"), "--foxglove")):
        error = refused(*options)
        assert error.code == 2 and "--foxglove" in str(error)
