import numpy as np
import pytest

from gritd.estimator.terramechanics.soils import DRY_SAND, LOOSE_SAND, MARS_LIKE
from gritd.tools.commands import reproduce
from gritd.tools.commands.reproduce import WHEEL


def test_prints_the_papers_figures_beside_ours(capsys: pytest.CaptureFixture[str]) -> None:
    assert reproduce.main(["--simulations", "500"]) == 0
    out = capsys.readouterr().out
    for printed in ("2.0 % (DP), 2.6 % (T)", "9.34 % and 12.15 %", "Fig. 3", "500 simulations"):
        assert printed in out
    assert out.count("could not be had") == 2 and out.count("no match is claimed") == 2
    assert "nan" not in out and "inf " not in out


def test_the_same_seed_prints_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    texts = []
    for seed in ("3", "3", "4"):
        reproduce.main(["--simulations", "300", "--seed", seed])
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1] != texts[2]


def test_a_bad_number_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        reproduce.main(["--simulations", "0"])
    assert stop.value.code == 2
    assert capsys.readouterr().err.strip().count("\n") == 0


def test_closed_forms_solve_their_integrals() -> None:
    assert all(
        values.max() < 2e-13 for values in reproduce.closed_form_differences(seed=1).values()
    )


def test_linearised_exponent_is_good_at_large_slip_and_poor_at_small() -> None:
    gaps = [
        np.max(np.abs(np.subtract(*reproduce.exponents(slip)))) for slip in (0.05, 0.2, 0.5, 0.8)
    ]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[0] > 0.05 and gaps[-1] < 0.03


@pytest.mark.parametrize(
    ("load", "low", "high"), [(40.0, 1.01, 1.06), (70.0, 0.69, 0.73), (120.0, 0.48, 0.52)]
)
def test_one_load_does_not_separate_cohesion_from_friction(
    load: float, low: float, high: float
) -> None:
    ratio = reproduce.sensitivity_ratio(DRY_SAND, np.linspace(0.05, 0.8, 6), load)
    assert np.all((ratio > low) & (ratio < high)), ratio


def test_linearisation_biases_the_fitted_cohesion_downwards() -> None:
    """What the effect stress_linearisation has to remove."""
    c, tan_phi = reproduce.fit(DRY_SAND.under(WHEEL.width))
    assert 690 < c < 760 and tan_phi == pytest.approx(0.62, abs=0.01)
    assert reproduce.fit(LOOSE_SAND.under(WHEEL.width))[0] < 0.7 * LOOSE_SAND.cohesion
    assert reproduce.fit(MARS_LIKE.under(WHEEL.width))[0] < 20
