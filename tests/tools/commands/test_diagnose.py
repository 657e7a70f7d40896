"""`gritd diagnose` from the command line: what is wrong is one line and an exit code, before any
work is done.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.cli.progress import Progress
from gritd.tools.commands import simulate
from gritd.tools.commands.diagnose import _steps_of, main
from gritd.tools.diagnose.method import OF_REFERENCE
from gritd.tools.diagnose.rig.signals import read_all, sha256, signals
from gritd.tools.recordings import provenance
from gritd.tools.report.reference import given

SCHEDULE = "segments:\n  - {duration: 3 s, load: 60 N, slip: 0.2, speed: 20 mm/s}\n"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    (folder / "schedule.yaml").write_text(SCHEDULE)
    assert (
        simulate.main(["--schedule", str(folder / "schedule.yaml"), "-o", str(folder / "run.mcap")])
        == 0
    )
    return folder / "run.mcap"


def said(*arguments: object) -> tuple[str, int]:
    with pytest.raises(CommandError) as error:
        main([str(a) for a in arguments])
    assert "\n" not in str(error.value)
    return str(error.value), error.value.code


def test_no_output_goes_where_it_does_harm(run: Path, tmp_path: Path) -> None:
    before = run.read_bytes()
    for option in ("--json", "--report", "--apply"):
        line, code = said(run, "--config", packaged(), option, run)
        assert "is read by this command" in line and code == USAGE
        line, code = said(run, "--config", packaged(), option, tmp_path)
        assert "found a folder" in line and code == USAGE
        line, code = said(run, "--config", packaged(), option, tmp_path / "no" / "x")
        assert "found no folder" in line and code == USAGE
        line, code = said(run, "--config", packaged(), option, "/proc/x")
        assert "may not write into /proc" in line and code == USAGE
    assert run.read_bytes() == before


def test_the_files_that_were_written_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line each on standard error."""
    (tmp_path / "schedule.yaml").write_text(SCHEDULE.replace("3 s", "12 s"))
    long = str(tmp_path / "long.mcap")
    simulate.main(["--schedule", str(tmp_path / "schedule.yaml"), "-o", long])
    own = tmp_path / "testbed.yaml"
    own.write_bytes(packaged().read_bytes())
    (tmp_path / "testbed.dbc").write_bytes(packaged("testbed.dbc").read_bytes())
    one, reported = [long, "--config", str(own), "--quick", "--jobs", "1"], "wrote {}"
    names = [tmp_path / name for name in ("a.json", "b.html", "c.yaml")]

    capsys.readouterr()
    options = zip(("--json", "--report", "--apply"), map(str, names), strict=True)
    assert main([*one, *(word for pair in options for word in pair)]) == 0
    said = capsys.readouterr()
    assert [line for line in said.err.splitlines() if "wrote" in line] == [
        reported.format(name) for name in names
    ]
    assert all(name.exists() for name in names) and "wrote" not in said.out

    assert main([*one, "--in-place"]) == 0
    said = capsys.readouterr()
    assert f"{own}: changed; as it was" in said.err and "wrote" not in said.err

    assert main(one) == 0
    assert "wrote" not in capsys.readouterr().err


def test_the_configuration_that_is_read_is_replaced_only_when_asked(
    run: Path, tmp_path: Path
) -> None:
    own = tmp_path / "testbed.yaml"
    own.write_bytes(packaged().read_bytes())
    line, code = said(run, "--config", own, "--apply", own)
    assert "is the configuration that is read" in line and code == USAGE

    line, code = said(run, "--config", own, "--apply", tmp_path / "new.yaml", "--in-place")
    assert "expected one of them" in line and code == USAGE
    assert "--in-place: expected --config" in said(run, "--in-place")[0]
    assert own.read_bytes() == packaged().read_bytes()


def test_what_cannot_be_read_is_told_apart(tmp_path: Path) -> None:
    (tmp_path / "text.mcap").write_text("none")
    for name, code in (("nowhere.mcap", USAGE), (".", DAMAGED), ("text.mcap", DAMAGED)):
        path = tmp_path / name
        line, found = said(path, "--config", packaged())
        assert str(path) in line and found == code


def test_a_recording_without_readings_or_cut_short_says_so(run: Path, tmp_path: Path) -> None:
    empty, cut = tmp_path / "empty.mcap", tmp_path / "cut.mcap"
    RunWriter(empty, (), "a: 1\n", RunInfo()).close()
    cut.write_bytes(run.read_bytes()[:2000])
    line, code = said(empty, "--config", packaged())

    assert line.startswith(f"{empty}: found no readings") and code == DAMAGED

    line, code = said(cut, "--config", packaged())
    assert line.startswith(f"{cut}: found no readings") and "(" in line and code == DAMAGED

    settings = config.load(packaged()).settings

    with pytest.raises(
        CommandError, match="found too few readings of wheel_encoder; expected both encoders"
    ):
        signals(read_all([empty])[0], settings, 10.0)


def test_a_run_that_ends_before_the_wheel_has_settled_says_so(tmp_path: Path) -> None:
    schedule, path = tmp_path / "schedule.yaml", tmp_path / "short.mcap"
    schedule.write_text(
        "ramp: 500 ms\nsegments:\n"
        "  - {duration: 5 s, load: 60 N, slip: 0.2, speed: 0 mm/s}\n"
        "  - {duration: 2 s, load: 60 N, slip: 0.2, speed: 5 mm/s}\n"
        "  - {duration: 2 s, load: 60 N, slip: 0.2, speed: 0 mm/s}\n"
    )
    assert simulate.main(["--schedule", str(schedule), "-o", str(path)]) == 0
    line, code = said(path, "--config", packaged())
    assert line.startswith(f"{path}: found no value of ") and code == DAMAGED
    assert line.endswith("expected a run that goes on for longer after the wheel has started")


def test_another_testbed_than_the_recorded_one_is_reported(run: Path) -> None:
    """The wrong file after --config makes a mismatch that no physics explains."""
    text = packaged().read_text(encoding="utf-8")
    other = config.loads(
        text.replace("radius: 72 mm", "radius: 80 mm", 1), "other.yaml", packaged().parent
    ).settings
    recordings = read_all([run])
    assert provenance.remarks(recordings, config.load(packaged()).settings) == []
    assert provenance.remarks(recordings, other) == [
        "run.mcap was recorded with wheel.radius 0.072 (configuration: 0.08)."
    ]


@pytest.mark.parametrize(
    ("was", "becomes", "named"),
    [
        ("radius: 72 mm", "radius: 90 mm", "wheel.radius 0.072 (configuration: 0.09)"),
        ("pulley_radius: 20 mm", "pulley_radius: 21 mm", "pulley_radius 0.02"),
    ],
)
def test_the_configuration_of_another_testbed_is_refused(
    run: Path, tmp_path: Path, was: str, becomes: str, named: str
) -> None:
    """Of another wheel, or of another name with other numbers; a mended calibration is none."""
    text = packaged().read_text(encoding="utf-8").replace(was, becomes, 1)
    if "pulley" in was:
        text = text.replace("testbed: single-wheel testbed", "testbed: the other one", 1)
    (tmp_path / "testbed.dbc").write_bytes(packaged("testbed.dbc").read_bytes())
    (tmp_path / "other.yaml").write_text(text, encoding="utf-8")

    line, code = said(run, "--config", tmp_path / "other.yaml")
    assert named in line and "--other-rig" in line and code == USAGE

    mended = config.loads(
        packaged().read_text(encoding="utf-8").replace("25 mm/V", "30 mm/V", 1), "", tmp_path
    )
    provenance.check_rig(read_all([run]), mended.settings, "mended.yaml")


def test_a_reference_is_the_recording_that_was_diagnosed(run: Path, tmp_path: Path) -> None:
    """By its SHA-256; one that is gone is named with both places where it was looked for."""
    earlier = tmp_path / "earlier.json"
    files = {str(run): sha256(run)}
    reported: dict[str, object] = {"verdict": "consistent", "redo": {"files": files}}

    earlier.write_text(json.dumps(reported))
    assert given([earlier], "same").files == (run,)

    files[str(run)] = "0" * 64
    earlier.write_text(json.dumps(reported))
    line, code = said(run, "--config", packaged(), "--reference", earlier)
    assert "expected the one that it diagnosed, by its SHA-256" in line and code == DAMAGED

    reported["redo"] = {"files": {"/nowhere/gone.mcap": "0" * 64}}
    earlier.write_text(json.dumps(reported))
    line, code = said(run, "--config", packaged(), "--reference", earlier)
    assert "/nowhere/gone.mcap" in line and str(tmp_path / "gone.mcap") in line and code == USAGE


@pytest.mark.parametrize("referred", [False, True])
def test_progress_never_goes_back(referred: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fits that are done count, those of a reference by itself too."""
    shares: list[float] = []
    monkeypatch.setattr(Progress, "at", lambda _, what, share=0.0: shares.append(share))
    step = _steps_of(Progress("diagnose"), referred)

    steps = [
        "fitting the soil and the noise",
        "screening every effect",
        "fitting the likely effects",
        "fitting the likely effects, 1 of 3",
        "fitting the likely effects, 3 of 3",
        "looking for a second effect beside backlash, or gear_ripple",
        "looking for a second effect beside backlash, or gear_ripple, 2 of 4",
        "looking for a third effect beside backlash and multipass, 1 of 2",
        "weighing what has no name",
        "weighing what has no name, 2 of 3",
    ]
    for what in [f"{OF_REFERENCE}{s}" for s in steps if referred] + steps:
        step(what)
    step("holding out runs and conditions")
    assert shares == sorted(shares) and 0.9 < shares[-1] < 1.0
    assert len(set(shares)) >= len(shares) - (2 if referred else 1)  # all fits done, the next begun
