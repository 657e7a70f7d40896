import math

import pytest

from gritd.estimator.terramechanics.soil import PressureSinkage
from gritd.estimator.terramechanics.soils import CLAYEY_SOIL, DRY_SAND, SANDY_LOAM, SOILS


def test_bekker_modulus_is_kc_over_b_plus_kphi() -> None:
    # dry sand under a 71 mm wheel: 0.9 kN/m^(n+1) / 0.071 m + 1523.4 kN/m^(n+2)
    assert DRY_SAND.pressure_sinkage.modulus(0.071) == pytest.approx(1_536_076, rel=1e-6)


@pytest.mark.parametrize("sinkage", [0.002, 0.02, 0.1])
def test_reece_modulus_gives_the_stress_of_equation_1(sinkage: float) -> None:
    k1, k2, b, n = 2.0e3, 1.5e6, 0.071, 1.1
    stress = (k1 + k2 * b) * (sinkage / b) ** n
    assert PressureSinkage("reece", n, k1, k2).modulus(b) * sinkage**n == pytest.approx(
        stress, rel=1e-12
    )


def test_both_forms_agree_where_they_say_the_same() -> None:
    # with n = 1 the two forms are one: (k1 + k2 b)(z/b) = (k1/b + k2) z
    reece, bekker = (
        PressureSinkage("reece", 1.0, 3e3, 2e6),
        PressureSinkage("bekker", 1.0, 3e3, 2e6),
    )
    assert [reece.modulus(b) for b in (0.05, 0.2)] == pytest.approx(
        [bekker.modulus(b) for b in (0.05, 0.2)]
    )


def test_named_soils_are_in_si() -> None:
    assert DRY_SAND.under(0.071).tan_phi == pytest.approx(math.tan(math.pi / 6))
    assert (SANDY_LOAM.under(0.1).cohesion, CLAYEY_SOIL.under(0.1).shear_modulus) == (1700.0, 0.01)
    assert all(1e5 < soil.under(0.071).modulus < 1e7 for soil in SOILS.values())
    assert all(soil.source for soil in SOILS.values())
