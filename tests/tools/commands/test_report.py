"""`gritd report`: what a run or a campaign shows without a diagnosis."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.config.settings import ConfiguredEffect, Uncertain, settings_of_run
from gritd.estimator.offline.bed_runs import bed_runs
from gritd.estimator.recording.salvage import read
from gritd.tools import main as cli
from gritd.tools.commands import simulate
from gritd.tools.report import lab


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("campaign")
    made = []
    for load_ in (45, 90):
        slips = "".join(
            f"  - {{duration: 3 s, load: {load_} N, slip: {slip}, speed: 20 mm/s}}\n"
            for slip in (0.1, 0.3, 0.5)
        )
        (folder / "s.yaml").write_text(f"segments:\n{slips}")
        made.append(folder / f"at{load_}.mcap")
        command = ["--schedule", str(folder / "s.yaml"), "--seed", str(load_), "-o", str(made[-1])]
        assert simulate.main(command) == 0
    return made


@pytest.fixture(scope="module")
def of(runs: list[Path]) -> list[lab.LabRun]:
    settings = load(packaged()).settings
    given = [(settings_of_run(settings, r.run), r) for r in map(read, runs)]
    return lab.lab_runs(list(bed_runs(given, settings.bed.repeatability)))


def test_the_original_equations_are_what_a_simulated_run_obeys(of: list[lab.LabRun]) -> None:
    """The simulator is Eqs. (1)-(10): they fit within the noise, the closed form does not."""
    for run in of:
        assert run.windows is not None
        for channel in ("torque", "drawbar_pull"):
            noise = run.windows.noise(channel)
            assert run.windows.off(channel, "original") < 4.0 * noise
        assert run.windows.off("torque", "closed") > 2.0 * run.windows.off("torque", "original")


@pytest.mark.parametrize("effect, value", [("bed_slope.angle", 0.1), ("bulldozing.share", 1.0)])
def test_the_curves_have_the_configured_effects(effect: str, value: float, tmp_path: Path) -> None:
    """As the simulation of `gritd diagnose` has them."""
    (tmp_path / "s.yaml").write_text(
        "segments:\n  - {duration: 6 s, load: 70 N, slip: 0.3, speed: 20 mm/s}\n"
    )
    run = tmp_path / "run.mcap"
    options = [
        "--schedule",
        str(tmp_path / "s.yaml"),
        "--effect",
        f"{effect}={value}",
        "-o",
        str(run),
    ]
    assert simulate.main(options) == 0

    name, _, parameter = effect.partition(".")
    settings, known = load(packaged()).settings, Uncertain(value, 0.0)
    knowing = replace(
        settings, effects=(*settings.effects, ConfiguredEffect(name, {parameter: known}))
    )
    offs = []
    for each in (settings, knowing):
        given = [(settings_of_run(each, recording.run), recording) for recording in [read(run)]]
        (made,) = lab.lab_runs(list(bed_runs(given, each.bed.repeatability)))
        assert made.windows is not None
        offs.append(
            made.windows.off("drawbar_pull", "original") / made.windows.noise("drawbar_pull")
        )
    assert offs[1] < 3.0 and offs[0] > 10.0


def test_the_table_has_load_slips_duration_and_hash(of: list[lab.LabRun], runs: list[Path]) -> None:
    rows = lab.table_of(of)
    assert [row[0] for row in rows] == ["at45", "at90"]
    assert [row[2] for row in rows] == ["45", "90"]
    assert rows[0][3] == "10 … 50" and rows[0][4] == "9.0"
    assert rows[0][5] == hashlib.sha256(runs[0].read_bytes()).hexdigest()[:12]


def test_the_page_is_whole_and_says_what_all_runs_know(
    runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "page.html"
    assert cli.main(["report", *map(str, runs), "-o", str(out)]) == 0
    page = out.read_text(encoding="utf-8")
    ElementTree.fromstring(page.removeprefix("<!DOCTYPE html>\n"))
    for words in ("2 runs together know the soil as c", "from the original equations",
                  "at45", "wheel_encoder", "SHA-256"):  # fmt: skip
        assert words in page
    assert np.count_nonzero([line == str(out) for line in capsys.readouterr().out.split()]) == 1


def test_the_forces_are_drawn_alone_as_svg_whose_words_are_words(
    runs: list[Path], tmp_path: Path
) -> None:
    out = tmp_path / "forces.svg"
    assert cli.main(["report", *map(str, runs), "--figure", str(out)]) == 0
    words = " ".join(ElementTree.parse(out).getroot().itertext())
    assert all(word in words for word in ("45 N", "90 N", "T [N·m]", "DP [N]", "slip [%]"))


def test_an_output_that_cannot_be_written_is_one_line(
    runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["report", str(runs[0]), "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", ["none/x.html", "file/x.html", "/proc/x.html"])
def test_an_output_is_checked_before_the_recordings_are_read(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    out, no_recording = tmp_path / name, tmp_path / "none.mcap"
    assert cli.main(["report", str(no_recording), "-o", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"gritd: {out}: ") and said.count("\n") == 1
    assert f"{out.parent}" in said and "expected" in said


def test_damage_is_told_by_the_name_of_its_file(
    runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As it is written, also where a sentence begins with it."""
    for name in ("run-1.mcap", "my run.mcap"):
        data = bytearray(runs[0].read_bytes())
        data[2] ^= 8  # of the magic
        (tmp_path / name).write_bytes(data)

        out = tmp_path / f"{name}.html"
        assert cli.main(["report", str(tmp_path / name), "-o", str(out)]) == 3
        assert "magic is damaged" in capsys.readouterr().err
        page = out.read_text(encoding="utf-8")
        assert f"<li>{name}: " in page and name.capitalize() not in page


def test_loads_of_one_run_are_told_apart(of: list[lab.LabRun]) -> None:
    """Each load is a curve of its own over slip; a few windows between two loads are none."""
    first, second = (run.windows for run in of)
    assert first is not None and second is not None
    changing = first.at(np.arange(2))
    changing.load[:] = (60.0, 75.0)
    light, heavy = lab.joined([second, first, changing]).by_load()
    assert (light.slip.tolist(), heavy.slip.tolist()) == (first.slip.tolist(), second.slip.tolist())
    assert light.off("torque", "closed") == pytest.approx(first.off("torque", "closed"))
