"""`gritd init`: a folder in which the next commands work."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.estimator.config.configuration import load
from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.commands import check_config, init
from gritd.tools.commands.init import main


def test_the_folder_can_be_worked_in_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "bench" / "rig"
    assert main([str(folder)]) == 0
    assert {path.name for path in folder.iterdir()} == {"testbed.yaml", "testbed.dbc", "README.md"}
    assert (folder / "README.md").read_text().count("\n") == 3

    assert check_config.main([str(folder / "testbed.yaml")]) == 0
    assert "valid" in capsys.readouterr().out


@pytest.mark.parametrize("count", [0, 1, 2])
def test_serial_ports_are_offered_by_the_name_that_stays(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    count: int,
) -> None:
    ports = [tmp_path / "by-id" / f"usb-Arduino_{n}-if00" for n in range(count)]
    for port in ports:
        port.parent.mkdir(exist_ok=True)
        port.touch()
    monkeypatch.setattr(init, "BY_ID", tmp_path / "by-id")
    assert main([str(tmp_path / "rig")]) == 0
    said = capsys.readouterr().out
    assert all(str(port) in said for port in ports)
    device = load(tmp_path / "rig" / "testbed.yaml").settings.devices["encoders"]
    assert device.port == (str(ports[0]) if count == 1 else "/dev/ttyACM0")


def test_no_file_is_replaced_and_none_is_left_half_way(tmp_path: Path) -> None:
    (tmp_path / "testbed.dbc").write_text("mine")
    with pytest.raises(CommandError, match="is there already") as error:
        main([str(tmp_path)])
    assert error.value.code == USAGE
    assert [path.name for path in tmp_path.iterdir()] == ["testbed.dbc"]
    assert (tmp_path / "testbed.dbc").read_text() == "mine"


def test_a_file_in_the_place_of_the_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "rig").write_text("")
    with pytest.raises(CommandError, match="expected a folder to write into") as error:
        main([str(tmp_path / "rig")])
    assert error.value.code == USAGE and "\n" not in str(error.value)
