"""docs/adding-an-effect.md, followed word for word; and docs/effects.md says what the effects'
files say.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator import effects
from gritd.estimator.config import configuration as config
from gritd.estimator.config.effects import configured
from gritd.estimator.effects import library
from gritd.estimator.effects.base import Effect
from gritd.tools.commands import simulate
from gritd.tools.dev import effect_figures
from gritd.tools.testbed.fingerprints import shown, typical
from tests.estimator.effects import test_effects

DOCS = Path(__file__).resolve().parents[3] / "docs"
PAGE = (DOCS / "adding-an-effect.md").read_text(encoding="utf-8")


def block(language: str, number: int = 0) -> str:
    """A fenced block of the page."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[number]


@pytest.fixture
def cable_drag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[type[Effect]]:
    """The page's file, saved under the page's name into a folder that belongs to the package."""
    (tmp_path / "cable_drag.py").write_text(block("python"))
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    found = library._find()
    monkeypatch.setitem(effects.EFFECTS, "cable_drag", found["cable_drag"])
    yield found["cable_drag"]
    sys.modules.pop("gritd.estimator.effects.cable_drag")


def test_the_folder_finds_it(cable_drag: type[Effect]) -> None:
    assert cable_drag.name == "cable_drag" and cable_drag.stage == "testbed"


def test_a_file_of_two_effects_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = block("python")
    two = one.replace("class CableDrag", "class CableDragTwice").partition("@dataclass")[2]
    (tmp_path / "cable_twice.py").write_text(f"{one}\n\n@dataclass{two}")
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    with pytest.raises(
        TypeError, match=r"cable_twice\.py: expected one subclass of Effect, found 2"
    ):
        library._find()
    sys.modules.pop("gritd.estimator.effects.cable_twice")


def test_the_tests_of_the_folder_accept_it(cable_drag: type[Effect]) -> None:
    hard_run = test_effects.run_of_everything()
    test_effects.test_is_described("cable_drag")
    test_effects.test_off_is_the_identity("cable_drag", hard_run)
    test_effects.test_finite_over_the_whole_box("cable_drag", hard_run)
    test_effects.test_continuous_in_its_parameters("cable_drag", hard_run)
    test_effects.test_shows_where_it_says("cable_drag")
    test_effects.test_takes_floats_as_the_loop_has_them("cable_drag")


def test_a_wrong_fingerprint_is_noticed(cable_drag: type[Effect]) -> None:
    found = shown(typical(cable_drag))
    assert not found.stands_out("drawbar_pull", "slip") and found.channel() != "torque"


def test_the_picture_is_drawn(cable_drag: type[Effect], tmp_path: Path) -> None:
    effect_figures.draw(cable_drag, tmp_path / "cable_drag.png")
    assert (tmp_path / "cable_drag.png").stat().st_size > 5000


def test_the_command_simulates_it(
    cable_drag: type[Effect], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    gritd, command, *arguments = block("sh", 2).split()
    assert (gritd, command) == ("gritd", "simulate")
    assert simulate.main(arguments) == 0
    simulate.main(["-o", "plain.mcap"])
    dragged, plain = (
        np.load(tmp_path / f"{name}.truth.npz")["drawbar_pull"] for name in ("dragged", "plain")
    )
    assert np.min(dragged - plain) == pytest.approx(-2.0)


def test_the_configuration_takes_it(cable_drag: type[Effect]) -> None:
    text = packaged().read_text(encoding="utf-8")
    text = re.sub(r"(?ms)^effects:.*?(?=^\w|^\.\.\.)", block("yaml"), text)
    read = config.loads(text, "testbed.yaml")
    (effect,) = configured(read.settings.effects)
    assert effect == cable_drag(force=2.0)  # type: ignore[call-arg]
    assert read.settings.effects[0].parameters["force"].sigma == pytest.approx(0.3)


def test_the_list_of_effects_is_up_to_date() -> None:
    assert (DOCS / "effects.md").read_text(encoding="utf-8") == effect_figures.page()
    for name in effects.EFFECTS:
        assert (DOCS / "effects" / f"{name}.png").exists(), (
            "run python -m gritd.tools.dev.effect_figures"
        )
