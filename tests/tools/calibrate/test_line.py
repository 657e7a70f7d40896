"""The line's σ, what is warned of, and the one line for what cannot be fitted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config.settings import Uncertain
from gritd.tools.calibrate.line import Point, fitted
from gritd.tools.calibrate.plateaus import plateaus
from gritd.tools.calibrate.sources import known_values
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import calibrate
from tests.tools.calibrate.bench import noisy, record, rig, staircase


def points(known: list[float], raw: list[float], sigma: float = 0.01) -> list[Point]:
    pairs = zip(known, raw, strict=True)
    return [Point(Uncertain(r, sigma), Uncertain(k)) for k, r in pairs]


def test_a_good_line_warns_of_nothing_and_a_bad_one_says_what_is_wrong() -> None:
    known = [0.0, 1.0, 2.0, 3.0, 4.0]
    good = fitted(points(known, [1.0, 3.01, 4.99, 7.0, 9.0]))
    assert good.warnings == () and good.scale.value == pytest.approx(0.5, abs=0.01)

    bent = fitted(points(known, [x + 0.1 * x**2 for x in known]))
    assert any("bend away" in line for line in bent.warnings)
    scattered = fitted(points(known, [0.0, 1.2, 1.8, 3.1, 3.9]))
    assert any("times what noise" in line for line in scattered.warnings)
    assert scattered.scale.sigma > 3.0 * good.scale.sigma
    idle = fitted(points(known, [2.60, 2.61, 2.59, 2.605, 2.60]))
    assert idle.warnings[0] == "the readings do not follow the known values"
    assert "a third" in fitted(points([0.0, 1.0], [0.0, 1.0])).warnings[0]


def test_what_is_no_line_is_one_sentence() -> None:
    for known, raw in (([1.0], [1.0]), ([1.0, 1.0], [1.0, 2.0]), ([0.0, 1.0], [2.0, 2.0])):
        with pytest.raises(CommandError) as error:
            fitted(points(known, raw))
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("noise", [1e-6, 0.01, 0.05])
def test_stretches_at_rest_are_found_whatever_the_noise(noise: float) -> None:
    levels = [0.0, 1.0, 2.0, 1.0, 1.0, 5.0]
    time, signal = staircase(levels)
    signal[(time > 15.8) & (time < 16.2)] += 1.0  # the block is taken away and put back
    found = plateaus(time, noisy(signal, noise, 1))
    assert [round(one.mean.value) for one in found] == levels
    for one, level in zip(found, levels, strict=True):
        assert abs(one.mean.value - level) <= 4.0 * one.mean.sigma + 1e-9


def test_known_values_in_words() -> None:
    assert [v.value for v in known_values("0, 10, 25.4 mm", "m")] == [0.0, 0.01, 0.0254]
    assert [v.value for v in known_values("0 A, -500 mA", "A")] == [0.0, -0.5]
    for text in ("1 2 mm", "", "3 N", "x mm", "1,,2 mm"):
        with pytest.raises(CommandError):
            known_values(text, "m")


def said(*arguments: object) -> str:
    with pytest.raises(CommandError) as error:
        calibrate.main([str(a) for a in arguments])
    assert "\n" not in str(error.value)
    return str(error.value)


def test_steps_state_where_the_values_were(tmp_path: Path) -> None:
    file = rig(tmp_path)
    time, physical = staircase([0.0, 0.01, 0.02])
    run = record(tmp_path / "r.mcap", {"sinkage_pot": (time, noisy(physical / 0.025, 2e-3, 1))})
    steps = ("--step", "1-3=0 mm", "--step", "9-11=20 mm", "--step", "5-7=10 mm")
    assert calibrate.main(["pot", "--config", str(file), "--from", str(run), *steps]) == 0


def test_the_live_sensors_are_read_when_enter_is_pressed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The sensors follow what the user was asked to set."""
    from contextlib import contextmanager
    from io import StringIO

    from gritd.estimator.messages.readings import Reading
    from gritd.tools.calibrate import live

    heights = iter([0.0, 0.01, 0.02])
    now = {"height": 0.0}

    def ask(what: str) -> None:
        now["height"] = next(heights)

    @contextmanager
    def reading(settings: object):  # type: ignore[no-untyped-def]
        rng = np.random.default_rng(1)
        yield lambda: [
            Reading(0, "sinkage_pot", now["height"] / 0.025 + 2e-3 * rng.standard_normal(), 0)
            for _ in range(5)
        ]

    monkeypatch.setattr(live, "reading", reading)
    monkeypatch.setattr(calibrate, "_ask", ask)
    monkeypatch.setattr("sys.stdin", StringIO())
    options = ["--known", "0, 10, 20 mm", "--seconds", "0.3", "--config", str(rig(tmp_path))]
    assert calibrate.main(["pot", *options, "--png", str(tmp_path / "fit.png")]) == 0
    reported = capsys.readouterr().out.partition("channels.sinkage_pot.scale: ")[2]
    assert float(reported.split()[0]) == pytest.approx(25.0, abs=0.5)
    assert (tmp_path / "fit.png").stat().st_size > 5000
