"""The whole way of a trial, with a stub in the diagnosis' place."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from shutil import copytree, rmtree

import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.commands import prove
from gritd.tools.proof.blind import batch, trial

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[3]
STUB = (sys.executable, "-m", "tests.tools.proof.blind.stub")
DRAWN = ("case", "seed", "stratum", "effects", "soil", "habits", "runs", "chain", "noise_factor")
ENVIRONMENT = {
    "PATH",
    "HOME",
    "LANG",
    "TMPDIR",
    "PYTHONPATH",
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "LC_CTYPE",
}
SMALL = ["--cases", "2", "--seed", "3", "--jobs", "1", "--strata", "none"]


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cases, drawn and sealed: copied by the tests that go on from there."""
    output = tmp_path_factory.mktemp("sealed") / "batch"
    assert prove.main([*SMALL, "--seal-only", "--output", str(output)], STUB) == 0
    return output


@pytest.fixture(scope="module")
def finished(sealed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The two cases, done."""
    output = copytree(sealed, tmp_path_factory.mktemp("finished") / "batch")
    assert resumed(output) == 0
    return output


def resumed(output: Path, *options: str, diagnose: tuple[str, ...] = STUB) -> int:
    """The exit code of `gritd prove --resume`."""
    return prove.main(["--resume", "--jobs", "1", "--output", str(output), *options], diagnose)


def test_the_diagnosis_sees_recordings_and_configuration_only(finished: Path) -> None:
    for result in finished.glob("cases/*/result.json"):
        said = json.loads(result.read_text(encoding="utf-8"))
        runs = [name for name in said["seen"] if name.startswith("run-")]
        assert runs and set(said["seen"]) - set(runs) == {"testbed.yaml", "testbed.dbc"}
        assert set(said["environment"]) <= ENVIRONMENT


def test_a_pair_is_asked_for_with_its_reference(tmp_path: Path) -> None:
    arguments = ["--cases", "2", "--seed", "3", "--jobs", "1", "--output", str(tmp_path)]
    arguments += ["--strata", "pair", "--worlds", "paper,strips"]
    assert prove.main(arguments, STUB) == 0
    for result in tmp_path.glob("cases/*/result.json"):
        said = json.loads(result.read_text(encoding="utf-8"))
        assert {"reference", "new", "testbed.yaml", "testbed.dbc"} == {
            name.split("/")[0] for name in said["seen"]
        }
        asked = said["asked"]
        before, after = asked.index("--reference"), asked.index("--config")
        assert all(name.startswith("new/run-") for name in asked[:before])
        assert all(name.startswith("reference/run-") for name in asked[before + 1 : after])
        assert asked[asked.index("--bed") + 1] in ("same", "prepared")
        assert len([name for name in said["seen"] if name.endswith(".mcap")]) == after - 1
    counted = json.loads((tmp_path / "score.json").read_text(encoding="utf-8"))
    assert counted["cases"] == 2


def test_of_two_effects_each_is_tried_alone_in_the_same_campaign(tmp_path: Path) -> None:
    arguments = ["--cases", "1", "--seed", "3", "--jobs", "1", "--output", str(tmp_path), "--keep"]
    assert prove.main([*arguments, "--strata", "two"], STUB) == 0
    (case,) = tmp_path.glob("cases/*")
    both, first, second = (
        json.loads((folder / "result.json").read_text(encoding="utf-8"))
        for folder in (case, case / "alone-1", case / "alone-2")
    )
    assert both["seen"] == first["seen"] == second["seen"]
    recorded = {
        (case / folder / "given" / "run-1.mcap").read_bytes()
        for folder in ("", "alone-1", "alone-2")
    }
    assert len(recorded) == 3

    counted = json.loads((tmp_path / "score.json").read_text(encoding="utf-8"))["two"]
    assert counted["both named where each alone alarms"]["n"] == 1


def test_seals_are_told_before_and_hold_after(finished: Path) -> None:
    seals = dict(
        line.split() for line in (finished / "seals.txt").read_text(encoding="utf-8").splitlines()
    )
    assert set(seals) == {"case-0001", "case-0002"}
    assert (finished / "score.html").exists()
    counted = json.loads((finished / "score.json").read_text(encoding="utf-8"))
    assert (
        counted["cases"] == 2 and counted["false_alarms"]["all"]["k"] == 2
    )  # the stub always names something


def test_recordings_are_removed_unless_kept(finished: Path) -> None:
    assert not list(finished.glob("cases/*/given/*.mcap"))


def test_a_finished_batch_resumes_to_the_same_score(
    finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = (finished / "score.json").read_text(encoding="utf-8")

    def never(*_: object) -> None:
        raise AssertionError("a finished case was run again")

    monkeypatch.setattr(trial, "diagnose", never)
    assert prove.main(["--resume", "--output", str(finished)], STUB) == 0
    assert (finished / "score.json").read_text(encoding="utf-8") == before


def test_a_batch_that_was_stopped_goes_on_with_the_same_cases(sealed: Path, tmp_path: Path) -> None:
    """Stopped after one case was sealed but not diagnosed, and before the other was drawn."""
    output = copytree(sealed, tmp_path / "batch")
    first, second = batch.resumed(output).specs(keep=True, diagnose=STUB)
    seal, drawn = first.seal.read_text(encoding="utf-8"), answers(second)
    rmtree(second.folder)
    second.answers.unlink()

    assert resumed(output, "--keep") == 0
    assert first.done and second.done
    assert first.seal.read_text(encoding="utf-8") == seal
    assert list(first.folder.glob("given/*.mcap"))
    again = answers(second)
    assert {name: again[name] for name in DRAWN} == {name: drawn[name] for name in DRAWN}


def answers(spec: trial.WorkerSpec) -> dict[str, object]:
    """The sealed answers of a case."""
    sealed: dict[str, object] = json.loads(spec.answers.read_text(encoding="utf-8"))["answers"]
    return sealed


def test_cases_are_sealed_now_and_diagnosed_later(sealed: Path, finished: Path) -> None:
    before = (sealed / "seals.txt").read_text(encoding="utf-8")
    assert len(before.splitlines()) == 2 and not list(sealed.glob("cases/*/outcome.json"))

    assert (finished / "seals.txt").read_text(encoding="utf-8") == before
    assert len(list(finished.glob("cases/*/outcome.json"))) == 2


def test_a_batch_that_is_stopped_leaves_nothing_running(sealed: Path, tmp_path: Path) -> None:
    """SIGTERM while a diagnosis runs that would never end."""
    pid = tmp_path / "pid"
    endless = f"import os, time; open({str(pid)!r}, 'w').write(str(os.getpid())); time.sleep(600)"
    code = "import sys; from gritd.tools.commands import prove; "
    code += f"prove.main(sys.argv[1:], (sys.executable, '-c', {endless!r}))"
    output = copytree(sealed, tmp_path / "batch")
    arguments = ["--resume", "--jobs", "1", "--output", str(output)]

    with subprocess.Popen(
        [sys.executable, "-c", code, *arguments], cwd=ROOT, stdout=subprocess.DEVNULL
    ) as process:
        wait_for(lambda: process.poll() is not None or (pid.exists() and pid.read_text()))
        process.terminate()
        assert process.wait(600.0) == 128 + signal.SIGTERM

    wait_for(lambda: not Path(f"/proc/{pid.read_text()}").exists())


def wait_for(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 600.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_changed_answer_is_noticed(finished: Path) -> None:
    answers = finished / "answers" / "case-0001.json"
    text = answers.read_text(encoding="utf-8")
    answers.write_text(text.replace('"noise_factor": ', '"noise_factor": 1'), encoding="utf-8")
    try:
        with pytest.raises(CommandError, match="other answers than were sealed"):
            prove.main(["--resume", "--output", str(finished)], STUB)
    finally:
        answers.write_text(text, encoding="utf-8")


def test_a_diagnosis_that_fails_counts_as_failed(
    sealed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    crash = (sys.executable, "-c", "import sys; sys.exit('gritd: cannot')")
    output = copytree(sealed, tmp_path / "batch")
    assert resumed(output, diagnose=crash) == 1

    out = capsys.readouterr().out
    assert "none → (failed)" in out and "gritd: cannot" in out


def test_mistakes_are_one_line(finished: Path, tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="found a batch; expected a new folder, or --resume"):
        prove.main([*SMALL, "--output", str(finished)], STUB)
    with pytest.raises(CommandError, match="found no batch"):
        prove.main(["--resume", "--output", str(tmp_path / "new")], STUB)
    with pytest.raises(CommandError, match="found 'nnoe'; expected some of none,"):
        prove.main(["--strata", "nnoe", "--output", str(tmp_path / "new")], STUB)
    with pytest.raises(CommandError, match="found 'moon'; expected some of paper,"):
        prove.main(["--worlds", "paper,moon", "--output", str(tmp_path / "new")], STUB)
    with pytest.raises(CommandError, match="found no foreign world for the stratum foreign"):
        prove.main(["--worlds", "paper", "--output", str(tmp_path / "new")], STUB)
    assert not (tmp_path / "new").exists()

    (tmp_path / "batch.json").write_text('{"cases": 2, "strata": ["none"], "seal": ""}')
    with pytest.raises(CommandError, match="found a batch of an earlier version"):
        prove.main(["--resume", "--output", str(tmp_path)], STUB)


def test_secrets_differ_unless_seeded(tmp_path: Path) -> None:
    one, other = (batch.started(tmp_path / name, 4, ("none",), None) for name in ("a", "b"))
    assert [spec.seed for spec in one.specs()] != [spec.seed for spec in other.specs()]
    same, again = (batch.started(tmp_path / name, 4, ("none",), 5) for name in ("c", "d"))
    assert [spec.seed for spec in same.specs()] == [spec.seed for spec in again.specs()]
    assert batch.resumed(tmp_path / "a").specs() == one.specs()


TRUST = "--trust-network"


@pytest.mark.slow
def test_the_same_cases_on_a_cluster(tmp_path: Path, finished: Path) -> None:
    """A real scheduler and two worker processes on loopback."""
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "host": "127.0.0.1",
        "dashboard_address": None,
    }

    with distributed.LocalCluster(processes=True, **options) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tcp://127.0.0.1:")
        output = tmp_path / "batch"
        assert (
            prove.main([*SMALL, "--output", str(output), "--scheduler", address, TRUST], STUB) == 0
        )

    here, there = (
        [
            json.loads((folder / "answers" / f"case-000{n}.json").read_text(encoding="utf-8"))[
                "answers"
            ]
            for n in (1, 2)
        ]
        for folder in (finished, output)
    )

    for one, other in zip(here, there, strict=True):
        assert {name: one[name] for name in DRAWN} == {name: other[name] for name in DRAWN}
        assert one["detectability"] == pytest.approx(
            other["detectability"], rel=1e-4
        )  # linear algebra on fewer threads


def test_a_scheduler_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    with pytest.raises(CommandError, match="found no scheduler; expected one that answers"):
        prove.main(
            [*SMALL, "--output", str(tmp_path / "b"), "--scheduler", "tcp://127.0.0.1:9", TRUST],
            STUB,
        )


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "127.0.0.1:9", "inproc://x"])
def test_a_scheduler_that_does_not_prove_who_it_is_is_refused(tmp_path: Path, address: str) -> None:
    with pytest.raises(CommandError, match="found no encryption; expected tls://") as refused:
        prove.main([*SMALL, "--output", str(tmp_path / "b"), "--scheduler", address], STUB)
    assert refused.value.code == 2


def test_tls_without_certificates_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    with pytest.raises(CommandError, match="found no certificates"):
        prove.main(
            [*SMALL, "--output", str(tmp_path / "b"), "--scheduler", "tls://127.0.0.1:9"], STUB
        )
