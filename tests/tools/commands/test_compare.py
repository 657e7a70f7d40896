"""`gritd compare`: errors in physical units, pictures of every run, the soil fitted where asked
for.
"""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.tools.cli.command import CommandError
from gritd.tools.cli.yaml_edit import EditedYaml
from gritd.tools.commands import simulate
from gritd.tools.commands.compare import compare, main
from gritd.tools.diagnose.explain.apply import set_discrepancy
from gritd.tools.report import comparison
from tests import forms

ODD = "<i>&$x_{"
SCHEDULE = """
ramp: 300 ms
segments:
  - {{duration: 1.5 s, load: {load} N, slip: 0.1, speed: 0 mm/s}}
  - {{duration: 3 s, load: {load} N, slip: 0.15, speed: 20 mm/s}}
  - {{duration: 3 s, load: {load} N, slip: 0.3, speed: 20 mm/s}}
  - {{duration: 3 s, load: {load} N, slip: 0.5, speed: 20 mm/s}}
"""


def run(folder: Path, name: str, load: float, *options: str) -> Path:
    schedule, out = folder / "schedule.yaml", folder / f"{name}.mcap"
    schedule.write_text(SCHEDULE.format(load=load))
    assert simulate.main(["--schedule", str(schedule), *options, "-o", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two runs in the configured soil, one of them with a name that tries to be markup and
    mathematics.
    """
    folder = tmp_path_factory.mktemp("plain")
    return [
        run(folder, name, load, "--seed", f"{load:g}")
        for name, load in (("at 45 N", 45.0), (ODD, 90.0))
    ]


@pytest.fixture(scope="module")
def testbed() -> config.Configuration:
    return config.load(packaged())


def test_what_the_model_knows_is_off_by_noise_alone(
    plain: list[Path], testbed: config.Configuration
) -> None:
    found = compare(plain, testbed, fitted=False)
    assert found.runs == ["at 45 N", ODD] and found.soil is None
    for channel, most in (("torque", 0.01), ("drawbar_pull", 0.12), ("sinkage", 1e-4)):
        for of in (None, *found.runs):
            assert 0.0 < found.rms(channel, of, "before") < most, (channel, of)


def test_a_learnt_discrepancy_is_simulated_and_compared(
    tmp_path: Path, testbed: config.Configuration
) -> None:
    """A rig that has it is off by noise alone where the configuration knows, by more where not."""
    document = EditedYaml(packaged().read_text(encoding="utf-8"), "testbed.yaml")
    set_discrepancy(document, forms.form(2), "testbed.yaml")
    path = tmp_path / "learnt.yaml"
    path.write_text(document.text(), encoding="utf-8")
    (tmp_path / "testbed.dbc").write_bytes(packaged("testbed.dbc").read_bytes())

    made = [run(tmp_path, "learnt", 60.0, "--config", str(path))]
    truth = json.loads(made[0].with_suffix(".truth.json").read_text())
    assert truth["discrepancy"]["load"] == 60.0
    knowing, blind = (compare(made, c, fitted=False) for c in (config.load(path), testbed))
    for channel, most in (("torque", 0.01), ("drawbar_pull", 0.12), ("sinkage", 1e-4)):
        assert knowing.rms(channel, None, "before") < most < blind.rms(channel, None, "before")
    assert "discrepancy" in knowing.baseline and "discrepancy" not in blind.baseline
    assert "discrepancy" in comparison.render(knowing)


def test_residual_is_what_was_left_out(tmp_path: Path, testbed: config.Configuration) -> None:
    found = compare(
        [run(tmp_path, "stiff", 70.0, "--effect", "coulomb_friction.loss=0.5")],
        testbed,
        fitted=False,
    )
    torque = next(t for t in found.traces if t.channel == "torque")
    values = zip(torque.measured, torque.before, torque.used, strict=True)
    driving = [measured - before for measured, before, used in values if used and before > 0.2]
    assert sum(driving) / len(driving) == pytest.approx(0.5, abs=0.01)
    assert found.rms("drawbar_pull", None, "before") < 0.3


def test_fit_finds_the_soil_within_what_was_known(
    tmp_path: Path, testbed: config.Configuration
) -> None:
    files = [run(tmp_path, f"{load:g}", load, "--soil", "tan_phi=0.63") for load in (45.0, 90.0)]
    found = compare(files, testbed, fitted=True)
    assert found.soil is not None
    assert found.soil.prior["tan_phi"].value == pytest.approx(0.577)
    assert found.soil.after["tan_phi"].value == pytest.approx(0.63, abs=0.02)
    assert found.rms("drawbar_pull", None, "after") < 0.2 * found.rms(
        "drawbar_pull", None, "before"
    )


def test_command_prints_and_draws(
    plain: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, sheet = tmp_path / "out.html", tmp_path / "out.png"
    files = [str(path) for path in plain]
    assert (
        main(
            [
                *files,
                "--config",
                str(packaged()),
                "--fit",
                "--report",
                str(page),
                "--png",
                str(sheet),
            ]
        )
        == 0
    )

    lines = capsys.readouterr().out.splitlines()
    assert (
        lines[0].split()[:2] == ["run", "torque"] and "[mm]" in lines[0] and "all runs" in lines[3]
    )
    assert any(line.startswith("cohesion c") and "1000 ± 300 Pa" in line for line in lines)

    root = ElementTree.fromstring(page.read_text(encoding="utf-8").removeprefix("<!DOCTYPE html>"))
    assert "gritd compare" in "".join(root.itertext()) and ODD in "".join(root.itertext())
    assert len(list(root.iter("figure"))) >= 4
    assert sheet.read_bytes().startswith(b"\x89PNG")


def test_two_runs_of_one_name_are_told_apart(
    plain: list[Path], testbed: config.Configuration, tmp_path: Path
) -> None:
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(plain[0].read_bytes())
    assert compare([plain[0], copy], testbed, fitted=False).runs == [
        "at 45 N (at 45 N.mcap)",
        "at 45 N (copy.mcap)",
    ]


def test_errors_are_one_line(tmp_path: Path) -> None:
    still = tmp_path / "still.yaml"
    still.write_text("segments:\n  - {duration: 3 s, load: 0 N, slip: 0.1, speed: 20 mm/s}")
    simulate.main(["--schedule", str(still), "-o", str(tmp_path / "lifted.mcap")])
    here = ["--config", str(packaged())]

    for arguments, said in (
        (["nowhere.mcap"], "nowhere.mcap"),
        (
            ["nowhere.mcap", "--report", str(tmp_path / "no" / "r.html")],
            "r.html: found no folder",
        ),
        (
            ["nowhere.mcap", "--png", str(tmp_path / "no" / "r.png")],
            "r.png: found no folder",
        ),
    ):
        with pytest.raises(CommandError) as error:
            main([*arguments, *here])
        assert said in str(error.value) and "\n" not in str(error.value)
