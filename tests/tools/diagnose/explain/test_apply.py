"""A calibrated rig is the baseline: what a reference campaign taught is modelled, what is new later
is named.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gritd.config import packaged
from gritd.tools.commands import simulate
from gritd.tools.commands.diagnose import main

LOADS = (35.0, 50.0, 65.0)
SEGMENT = "  - {{duration: {} s, load: {} N, slip: {}, speed: {} mm/s}}\n"
SLIPS = (0.08, 0.2, 0.4)


def campaign(folder: Path, seed: int, *effects: str) -> list[str]:
    """Recordings of three runs, one a load, by `gritd simulate`."""
    folder.mkdir()
    files = []
    for number, load in enumerate(LOADS):
        slips = SLIPS[number:] + SLIPS[:number]
        schedule = folder / f"{number}.yaml"
        rest = SEGMENT.format(2, load, 0.1, 0)
        schedule.write_text(
            "segments:\n"
            + rest
            + "".join(SEGMENT.format(6, load, slip, (20, 30, 15)[number]) for slip in slips)
        )
        files.append(str(folder / f"run{number + 1}.mcap"))
        options = [option for effect in effects for option in ("--effect", effect)]
        simulate.main(
            ["--schedule", str(schedule), "--seed", str(seed + number), *options, "-o", files[-1]]
        )
    return files


def diagnosed(
    files: list[str], configuration: Path, folder: Path, *options: str
) -> tuple[dict[str, Any], Path]:
    """The JSON, and the configuration that --apply wrote."""
    result, applied = folder / "d.json", folder / f"{configuration.stem}-new.yaml"
    written = ["--config", str(configuration), "--json", str(result), "--apply", str(applied)]
    assert main([*files, *written, *options]) == 0
    return json.loads(result.read_text()), applied


def accepted(found: dict[str, Any]) -> set[str]:
    return {h["effect"] for h in found["hypotheses"] if h["accepted"]}


@pytest.mark.long
def test_what_is_new_in_a_later_campaign_is_what_is_named(tmp_path: Path) -> None:
    """By the command line: friction found on a smooth wheel, applied; then a wheel with lugs on the
    same rig.
    """
    friction = "coulomb_friction.loss=0.25"
    lugs = (
        "grousers.height=0.005",
        "grousers.grip=0.2",
        "grousers.ripple_cos=0.08",
        "grousers.count=12",
    )
    smooth = campaign(tmp_path / "smooth", 1, friction)
    found, calibrated = diagnosed(smooth, packaged(), tmp_path)
    assert found["verdict"] == "explained"
    first = {
        n
        for h in found["hypotheses"]
        if h["accepted"]
        for n in (h["effect"], *h["indistinguishable_from"])
    }
    assert "coulomb_friction" in first
    known = accepted(found)
    same, _ = diagnosed(campaign(tmp_path / "again", 11, friction), calibrated, tmp_path)
    assert same["verdict"] == "consistent" and known <= set(same["baseline"])
    later, both = diagnosed(campaign(tmp_path / "lugs", 21, friction, *lugs), calibrated, tmp_path)
    assert later["verdict"] == "explained" and not accepted(later) & known
    named = {
        n
        for h in later["hypotheses"]
        if h["accepted"]
        for n in (h["effect"], *h["indistinguishable_from"])
    }
    assert "grousers" in named, later["summary"]
    assert all(name in both.read_text() for name in known | accepted(later))


@pytest.mark.long
def test_what_a_reference_has_too_is_written_with_what_is_new(tmp_path: Path) -> None:
    """Else the next campaign on the same rig would find the reference's own friction new."""
    friction, slope = "coulomb_friction.loss=0.25", "bed_slope.angle=0.04"
    before = campaign(tmp_path / "before", 1, friction)
    new = campaign(tmp_path / "new", 11, friction, slope)
    given = ["--reference", *before, "--bed", "same"]
    found, written = diagnosed(new, packaged(), tmp_path, *given)
    assert accepted(found) == {"bed_slope"}
    again, _ = diagnosed(campaign(tmp_path / "again", 21, friction, slope), written, tmp_path)
    assert again["verdict"] == "consistent", again["summary"]
