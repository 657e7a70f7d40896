"""What `--apply` writes: the user's own file with effects and soil, in place only when asked."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Effect
from gritd.estimator.filter.learnt_soil import learnt_soil
from gritd.estimator.model.learnt import LearntForm
from gritd.tools.commands import diagnose, init
from gritd.tools.diagnose.explain.apply import applied, rewritten
from gritd.tools.diagnose.explain.result import Diagnosis, Hypothesis, Law, Quantity, Reference
from tests import forms
from tests.tools.report.cases import base, soil

REECE = ("  k1: 100 kPa\n  k2: 900 kN/m^3\n", "k_c: 0.9 kN/m^(n+1)", "k_phi: 1523.4 kN/m^(n+2)")


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    init.main([str(tmp_path)])
    return tmp_path / "testbed.yaml"


def found(**changed: object) -> Diagnosis:
    """Coulomb friction and a soil."""
    friction = Hypothesis(
        "coulomb_friction", 0.97, 30.0, {"loss": Quantity(0.2513, 0.021, "N*m")}, accepted=True
    )
    return base(verdict="explained", hypotheses=(friction,), soil=soil(812.0, 64.0, 0.0), **changed)


def test_effects_and_soil_are_the_next_prior_and_comments_stay(rig: Path) -> None:
    text, before = rig.read_text(), config.load(rig)
    after = rewritten(text, before, found())
    settings = config.loads(after, "new.yaml", rig.parent).settings

    prior = settings.soil
    assert (prior.cohesion.value, prior.cohesion.sigma) == (812.0, 64.0)
    assert (prior.tan_phi.value, prior.tan_phi.sigma) == (0.571, 0.008)
    assert prior.shear_modulus.value == pytest.approx(0.0246)
    assert (prior.exponent.value, prior.exponent.sigma) == (1.098, 0.006)
    assert prior.pressure_sinkage.modulus(settings.wheel.width) == pytest.approx(1.55e6)
    assert prior.modulus_sigma == pytest.approx(2.1e4 / 1.55e6)
    assert {e.name for e in settings.effects} == {"stress_linearisation", "coulomb_friction"}

    comments = [line.partition("#")[2] for line in text.splitlines() if "#" in line]
    assert [c for c in comments if c not in after] == []
    assert replace(settings, soil=before.settings.soil, effects=()) == replace(
        before.settings, effects=()
    )


@pytest.mark.parametrize("carries", [True, False])
def test_a_misfit_without_a_name_has_one_carrier(rig: Path, carries: bool) -> None:
    """A law with the soil beside it, or the discrepancy with the soil that is averaged beside it:
    both would count the misfit twice.
    """
    terms = {"torque_slip": Quantity(-0.6, 0.05, "N*m")}
    beside = {**soil(812.0, 64.0, 0.0).after, "c": Quantity(900.0, 70.0, "Pa")}
    law = Law("torque", "torque −0.6·i", {}, 0.95, terms, soil=beside) if carries else None
    averaged = soil(812.0, 64.0, 0.0)
    diagnosis = base(verdict="unlisted", hypotheses=(), soil=averaged, law=law, learnt=learnt())

    after = rewritten(rig.read_text(), config.load(rig), diagnosis)
    settings = config.loads(after, "new.yaml", rig.parent).settings
    assert any(e.name == "empirical_law" for e in settings.effects) == carries
    assert (settings.discrepancy is None) == carries
    assert settings.soil.cohesion.value == (900.0 if carries else 812.0)


@pytest.mark.parametrize("sigmas", [0.003, 1.0, 1e3])
@pytest.mark.parametrize("end", ["low", "high"])
def test_what_is_written_of_any_effect_can_be_read_again(
    rig: Path, sigmas: float, end: str
) -> None:
    """Parameters at their bounds, known well or not at all: a fit may leave them so."""
    found = [
        Hypothesis(name, 0.9, 30.0, _at_bounds(effect, sigmas, end), accepted=True)
        for name, effect in EFFECTS.items()
        if not effect.filter_only
    ]
    before, diagnosis = config.load(rig), base(verdict="explained", hypotheses=tuple(found))

    after = rewritten(rig.read_text(), before, diagnosis)
    read = {
        e.name: e.parameters for e in config.loads(after, "new.yaml", rig.parent).settings.effects
    }
    for hypothesis in found:
        for name, stated in hypothesis.parameters.items():
            value = read[hypothesis.effect][name].value
            assert value == pytest.approx(stated.value, abs=max(stated.sigma, 1e-9))


def _at_bounds(effect: type[Effect], sigmas: float, end: str) -> dict[str, Quantity]:
    """Every parameter at one of its bounds, where it has one; σ in expected sizes."""
    at = {p: getattr(p, end) for p in effect.parameters()}
    return {
        p.name: Quantity(value if abs(value) < 1e3 else p.centre, sigmas * p.sigma, p.unit)
        for p, value in at.items()
    }


def test_the_modulus_is_right_in_reeces_form_too(rig: Path) -> None:
    text = rig.read_text()
    moduli = text[text.index("  k_c:") : text.index("  modulus_sigma")]
    text = text.replace(moduli, REECE[0])
    after = rewritten(text, config.loads(text, "x", rig.parent), found())
    settings = config.loads(after, "new.yaml", rig.parent).settings
    assert settings.soil.pressure_sinkage.form == "reece"
    assert settings.soil.pressure_sinkage.modulus(settings.wheel.width) == pytest.approx(1.55e6)


def test_a_friction_angle_stays_an_angle(rig: Path) -> None:
    text = rig.read_text().replace(
        "tan_phi: {value: 0.577, sigma: 0.06}", "phi: {value: 30 deg, sigma: 3 deg}"
    )
    after = rewritten(text, config.loads(text, "x", rig.parent), found())
    friction = config.loads(after, "new.yaml", rig.parent).settings.soil.tan_phi
    assert friction.value == pytest.approx(0.571, abs=1e-4)
    assert friction.sigma == pytest.approx(0.008, rel=0.01)
    assert "phi: {value: 29.7" in after and "tan_phi:" not in after


def test_a_soil_that_is_not_believed_stays_out(rig: Path) -> None:
    """Where something without a name remains, the soil has taken a part of it."""
    before = config.load(rig)
    for verdict in ("unlisted", "insufficient"):
        after = rewritten(rig.read_text(), before, replace(found(), verdict=verdict))
        assert config.loads(after, "x", rig.parent).settings.soil == before.settings.soil


def test_a_soil_beyond_the_filters_bounds_is_put_at_the_bound(rig: Path) -> None:
    fitted = found()
    assert fitted.soil is not None
    far = dict(fitted.soil.after) | {"k": Quantity(4e-4, 1e-4, "m")}
    after = rewritten(
        rig.read_text(), config.load(rig), replace(fitted, soil=replace(fitted.soil, after=far))
    )
    assert config.loads(after, "x", rig.parent).settings.soil.shear_modulus.value == 1e-3


def test_again_and_again_leaves_one_line_of_origin(rig: Path) -> None:
    once = rewritten(rig.read_text(), config.load(rig), found())
    again = rewritten(once, config.loads(once, "x", rig.parent), found(summary="Another."))
    assert again.count("made by gritd diagnose") == 1 and "Another." in again
    assert again.partition("\n")[2] == once.partition("\n")[2]


def test_the_filters_comparison_takes_the_effects_alone(rig: Path) -> None:
    before = config.load(rig)
    settings = config.loads(applied(before, found()), "x").settings
    assert settings.soil == before.settings.soil and len(settings.effects) == 2


def test_in_place_keeps_what_was_there(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = rig.read_text()
    arguments = argparse.Namespace(redo=None, config=str(rig), apply=rig)
    diagnose._apply(arguments, found(), config.load(rig))
    backup = rig.with_name("testbed.yaml.bak")
    assert backup.read_text() == before != rig.read_text()
    assert str(backup) in capsys.readouterr().err


def learnt() -> LearntForm:
    return forms.form(7, soil=forms.soil((1.0, 1.0, 1.0)))


def test_the_discrepancy_stands_beside_the_soil_that_is_written(rig: Path) -> None:
    """Also where the verdict is unlisted; and the soil is the one its correlation is with."""
    for verdict in ("explained", "unlisted", "consistent"):
        diagnosis = replace(found(), verdict=verdict, learnt=learnt())
        settings = config.loads(
            rewritten(rig.read_text(), config.load(rig), diagnosis), "new.yaml", rig.parent
        ).settings
        form = settings.discrepancy
        assert form is not None and form.soil is not None and settings.soil.cohesion.value == 812.0
        prior = settings.soil.cohesion.value, settings.soil.tan_phi.value
        assert (form.soil.cohesion, form.soil.tan_phi) == prior
        assert replace(form, soil=None) == replace(learnt(), soil=None)
        assert learnt_soil(settings) == form.soil


def test_the_discrepancy_stays_out_where_the_recordings_show_little(rig: Path) -> None:
    diagnosis = replace(found(), verdict="insufficient", learnt=learnt())
    after = rewritten(rig.read_text(), config.load(rig), diagnosis)
    settings = config.loads(after, "new.yaml", rig.parent).settings
    assert settings.discrepancy is None
    assert settings.soil == config.load(rig).settings.soil


def test_a_second_discrepancy_takes_the_place_of_the_first(rig: Path) -> None:
    first = rewritten(rig.read_text(), config.load(rig), replace(found(), learnt=learnt()))
    again = replace(found(), learnt=replace(learnt(), load=50.0))
    second = rewritten(first, config.loads(first, "first", rig.parent), again)
    form = config.loads(second, "second", rig.parent).settings.discrepancy
    assert form is not None and form.load == 50.0
    assert second.count("discrepancy:") == 1


def test_what_the_reference_shows_by_itself_is_written_too(rig: Path) -> None:
    """And where there is more of it in the new campaign, the sum."""
    had = {
        "coulomb_friction": {"loss": Quantity(0.1, 0.02, "N*m")},
        "viscous_friction": {"damping": Quantity(0.4, 0.1, "N*m*s/rad")},
    }
    held_against = Reference("explained", 1.0, "", had)
    text, before = rig.read_text(), config.load(rig)
    after = rewritten(text, before, found(reference=held_against))
    effects = {e.name: e for e in config.loads(after, "new.yaml", rig.parent).settings.effects}
    assert effects["coulomb_friction"].parameters["loss"].value == pytest.approx(0.3513, abs=1e-3)
    assert effects["viscous_friction"].parameters["damping"].value == pytest.approx(0.4)

    unknown = replace(found(reference=held_against), verdict="insufficient", hypotheses=())
    assert "viscous_friction" not in rewritten(text, before, unknown)
