"""Recordings in the page: the values of the ticks, at any zoom, at once and then whole."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import gritd
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import replay
from gritd.tools.view import recorded
from gritd.tools.view.campaign import ViewedCampaign
from gritd.tools.view.charts import CHARTS
from gritd.tools.view.downsample import envelope
from gritd.tools.view.recorded import Recordings
from gritd.tools.view.run_curves import FIELDS, RunCurves
from tests.tools.view.browser import CHROMIUM, browser

STEPS = [{"duration": 4.0, "load": load, "slip": 0.2, "speed": 0.02} for load in (40.0, 80.0)]


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short runs with ticks."""
    folder = tmp_path_factory.mktemp("runs")
    for seed in (1, 2):
        raw = folder / f"raw-{seed}.mcap"
        gritd.simulate(schedule=STEPS, seed=seed).write(str(raw))
        assert replay.main([str(raw), "-o", str(folder / f"run-{seed}.mcap")]) == 0
    return [folder / "run-1.mcap", folder / "run-2.mcap"]


@pytest.fixture(scope="module")
def ticks(paths: list[Path]) -> Rows:
    return read(paths[0]).arrays("/tick")


@pytest.fixture
def recordings(paths: list[Path]) -> Iterator[Recordings]:
    yield Recordings(paths)


def test_a_moment_has_the_values_of_its_tick(recordings: Recordings, ticks: Rows) -> None:
    for row in (len(ticks) // 3, len(ticks) - 1):
        at = (ticks["evaluated"][row] - ticks["evaluated"][0]) * 1e-9
        reported = recordings.moment(0, "time", at)
        assert reported["sequence"] == ticks["sequence"][row]
        assert reported["values"][0]["value"] == f"{ticks['cohesion'][row]:.0f}"
        assert reported["values"][1]["value"] == f"{ticks['tan_phi'][row]:.4f}"
        json.dumps(reported["headline"])


def test_a_first_look_and_the_whole_show_the_same_run(
    recordings: Recordings, paths: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorded, "SMALL", 0)
    first = Recordings(paths)
    assert first.described()["busy"]
    some, all_of_it = first.runs[0].curves, recordings.runs[0].curves
    assert 1 < len(some.time) <= len(all_of_it.time)
    assert some.duration == pytest.approx(all_of_it.duration, abs=0.5)

    first._read_on()
    assert not first.described()["busy"]
    assert first.runs[0].curves.values.tobytes() == all_of_it.values.tobytes()


def test_the_way_never_goes_back_and_curves_follow_it(recordings: Recordings) -> None:
    curves = recordings.runs[1].curves
    assert (np.diff(curves.way) >= 0.0).all() and curves.way[-1] > 0.05
    places, columns, soil = recordings.stretch(1, "way", None, 200)
    assert len(places) <= 200 and (np.diff(places) >= 0.0).all()
    assert columns.shape[0] == len(places) and soil.shape[1] == 2


def test_a_wide_zoom_of_a_long_run_keeps_least_and_greatest() -> None:
    random = np.random.default_rng(3)
    count = 100_000
    values = np.zeros((count, len(FIELDS)), np.float32)
    values[:, 0] = random.standard_cauchy(count)
    time = np.arange(count) * 0.004
    curves = RunCurves(0, time, time, values, whole=True)
    _, columns = curves.stretch("time", (0.0, 400.0), 300)
    factor = CHARTS[0].factor
    assert np.nanmin(columns[:, 0]) == pytest.approx(values[:, 0].min() * factor)
    assert np.nanmax(columns[:, 0]) == pytest.approx(values[:, 0].max() * factor)
    assert envelope(time, values.astype(float), (0.0, 400.0), 300)[0].shape == (300,)


def test_a_recording_without_ticks_says_how_to_get_them(paths: list[Path]) -> None:
    with pytest.raises(CommandError) as error:
        Recordings([paths[0].parent / "raw-1.mcap"])
    assert error.value.code == 3


@pytest.mark.parametrize("content", [None, b"", b"no recording at all" * 9])
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "x.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(CommandError) as error:
        Recordings([path])
    assert error.value.code == (2 if content is None else 3) and str(path) in str(error.value)


SET = (
    """(e => {{ e.value = {}; e.dispatchEvent(new Event('{}')) }})(document.querySelector('{}'))"""
)


def test_what_two_runs_were_made_with_is_compared(recordings: Recordings) -> None:
    keys = {each["key"]: each["matters"] for each in recordings.differences(0, 1)}
    assert keys == {"run.name": False}
    assert recordings.differences(0, 0) == []


def test_a_campaign_has_forces_by_load_and_estimates_run_by_run(paths: list[Path]) -> None:
    campaign = ViewedCampaign(paths)
    assert campaign.answer == {"state": "computing"}
    campaign._run()
    assert campaign.answer["state"] == "done" and len(campaign.answer["runs"]) == 2
    for run in campaign.answer["runs"]:
        assert [round(part["load"], -1) for part in run["loads"]] == [40.0, 80.0]
        for part in run["loads"]:
            measured, original = part["torque"]["measured"], part["torque"]["original"]["value"]
            assert len(measured) == len(part["slip"])
            assert np.mean(original) == pytest.approx(np.mean(measured), rel=0.05)
    json.dumps(campaign.answer, allow_nan=False)


def test_a_campaign_that_cannot_be_computed_says_why(tmp_path: Path) -> None:
    campaign = ViewedCampaign([tmp_path / "none.mcap"])
    campaign._run()
    assert campaign.answer["state"] == "failed" and "none.mcap" in campaign.answer["reason"]


@pytest.mark.long
@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")
def test_runs_over_each_other_play_scrub_and_zoom(paths: list[Path], tmp_path: Path) -> None:
    pytest.importorskip("uvicorn", reason="needs gritd[view]")
    from tests.tools.view.process import viewing

    with viewing(*map(str, paths)) as (_, address), browser(tmp_path / "profile") as tab:
        tab.screen(390, 844)
        tab.open(address)
        tab.wait("document.querySelectorAll('#runs tbody tr').length === 2")
        tab.wait(
            "document.body.dataset.sequence > 0 && document.querySelector('#span').textContent"
        )
        assert tab.value("document.documentElement.scrollWidth") <= 390
        first = "document.querySelector('#runs tbody th').textContent"
        named = "document.querySelector('#runs [data-by=name] button').click()"
        order = [tab.value(f"{named}; {first}") for _ in range(2)]
        assert len(set(order)) == 2  # ascending, then descending

        last = int(tab.value("document.body.dataset.sequence"))

        tab.value(SET.format(500, "input", "#scrub"))
        tab.wait(f"Math.abs(document.body.dataset.sequence - {last} / 2) < {last} / 20")
        tab.key(" ", " ")
        tab.wait(f"document.body.dataset.sequence > 0.6 * {last}")
        whole = tab.value("document.querySelector('#span').textContent")
        tab.key("+", "+")
        tab.wait(f"document.querySelector('#span').textContent !== {whole!r}")
        tab.value(SET.format("'way'", "change", "#along"))
        tab.wait("document.querySelector('#span').textContent.endsWith(' m')")
        tab.value("document.querySelector('#differences').open = true")
        tab.wait("document.querySelector('#keys-of tbody').textContent.includes('run.name')")
        tab.wait("document.body.dataset.campaign === 'done'")
        assert tab.value("document.querySelectorAll('#forces figure').length") >= 3
        assert tab.value("document.documentElement.scrollWidth") <= 390
        assert tab.complaints == []
        assert all(url.startswith((address, "data:")) for url in tab.asked)
