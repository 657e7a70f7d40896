"""A command that changes the user's configuration replaces nothing without a backup."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.yamltree import ConfigError
from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.cli.configuration_file import edited, save, target
from gritd.tools.commands import init

GOOD = packaged().read_text(encoding="utf-8")
OTHER = GOOD.replace("radius: 72 mm", "radius: 73 mm")


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    init.main([str(tmp_path / "rig")])
    return tmp_path / "rig" / "testbed.yaml"


def test_where_it_goes(rig: Path) -> None:
    other = rig.with_name("new.yaml")
    assert target(rig, other, False, "--apply") == other
    assert target(rig, None, True, "--apply") == rig
    assert target(rig, rig, True, "--apply") == rig

    for output, in_place, line in (
        (rig, False, "is the configuration that is read"),
        (rig.parent / ".." / "rig" / "testbed.yaml", False, "is the configuration that is read"),
        (None, False, "expected --apply NEW.yaml, or --in-place"),
        (other, True, "expected one of them"),
        (rig.parent / "none" / "new.yaml", False, "found no folder"),
        (rig / "new.yaml", False, "found no folder"),
    ):
        with pytest.raises(CommandError, match=line) as error:
            target(rig, output, in_place, "--apply")
        assert error.value.code == USAGE


def test_a_source_that_may_be_cut_short_is_refused(rig: Path) -> None:
    """What is made of a part would look whole."""
    for text in (GOOD.removesuffix("...\n"), GOOD.removeprefix("---\n").removesuffix("...\n")):
        rig.write_text(text)
        for source in (edited, lambda path: target(path, None, True, "--apply")):
            with pytest.raises(ConfigError, match=r"'\.\.\.' as the last line"):
                source(rig)


def test_what_is_written_is_refused_when_it_is_cut(rig: Path) -> None:
    """Of a file by hand that begins with comments, too."""
    by_hand = "# ours\n\n# of March\n" + GOOD.removeprefix("---\n")
    rig.write_text(by_hand)
    save(edited(rig).text(), rig, rig)
    written = rig.read_text()
    assert written.startswith("# ours\n\n# of March\n") and written.endswith("...\n")
    assert written.count("---\n") == 1
    save(edited(rig).text(), rig, rig)
    assert rig.read_text() == written
    rig.write_text(written[: len(written) // 2])
    with pytest.raises(ConfigError):
        config.load(rig)


def test_in_place_keeps_every_earlier_one(rig: Path) -> None:
    rig.chmod(0o640)
    first, second = save(OTHER, rig, rig), save(GOOD, rig, rig)
    assert first is not None and second is not None and first != second
    assert [path.read_text() for path in (first, second, rig)] == [GOOD, OTHER, GOOD]
    assert rig.stat().st_mode & 0o777 == 0o640
    assert len(list(rig.parent.iterdir())) == 5


def test_elsewhere_the_can_messages_are_found_too(rig: Path, tmp_path: Path) -> None:
    place = tmp_path / "new.yaml"
    assert save(OTHER, rig, place) is None
    dbc = config.load(place).settings.devices["bus"].dbc
    assert Path(dbc).resolve() == rig.parent / "testbed.dbc"
    assert "dbc: rig/testbed.dbc" in place.read_text() and rig.read_text() == GOOD


def test_what_is_no_configuration_is_not_written(rig: Path) -> None:
    with pytest.raises(ConfigError):
        save(GOOD.replace("radius: 72 mm", "radius: -72 mm"), rig, rig)
    assert rig.read_text() == GOOD and len(list(rig.parent.iterdir())) == 3


def test_a_place_that_cannot_be_written_is_one_line(rig: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CommandError, match="not a directory") as error:
        save(OTHER, rig, tmp_path / "file" / "new.yaml")
    assert error.value.code == USAGE
