"""What is measured of the cost of things: every figure, and by the engine it names."""

from __future__ import annotations

import pytest

from gritd.estimator.filter.filterpy_engine import FilterpyEngine
from gritd.tools.bench import measure

SMALL = measure.Sizes(seconds=3.0, ticks=300, repeats=1, samples=100, simulated=3.0)
SECTIONS = ("tick", "replay", "forces", "update", "recording", "forward_model")


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    return measure.measure(SMALL, tmp_path_factory.mktemp("bench"))


def test_every_figure_is_a_positive_number(figures):
    assert tuple(figures) == SECTIONS
    assert all(value > 0.0 for section in figures.values() for value in section.values())


def test_ratios_and_shares_are_those_of_their_parts(figures):
    forces, update, tick = figures["forces"], figures["update"], figures["tick"]
    assert forces["ratio"] == pytest.approx(forces["quadrature"] / forces["closed_form"])
    assert forces["ratio_in_batch"] == pytest.approx(
        forces["quadrature_in_batch"] / forces["closed_form_in_batch"]
    )
    assert update["ratio"] == pytest.approx(update["filterpy"] / update["plain"])
    assert tick["share_of_budget"] == pytest.approx(tick["at_99_percent"] / 0.004)
    assert tick["median"] <= tick["at_99_percent"]


def test_each_replay_runs_the_engine_it_names(tmp_path, monkeypatch):
    applied = []
    honest = FilterpyEngine.update
    monkeypatch.setattr(
        FilterpyEngine, "update", lambda *given: applied.append(1) or honest(*given)
    )
    subject = measure._subject(SMALL, tmp_path)
    monkeypatch.setattr(measure, "ENGINES", ("plain",))
    assert set(measure.replay(subject)) == {"plain_speed", "plain_best"} and not applied
    monkeypatch.setattr(measure, "ENGINES", ("filterpy",))
    measure.replay(subject)
    assert applied
