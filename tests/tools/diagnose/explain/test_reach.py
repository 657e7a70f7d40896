"""The σ of an effect's parameters holds also where they make up for each other."""

import pytest

from gritd.estimator.effects import make
from tests.tools.diagnose.campaigns import diagnosed, plan

pytestmark = pytest.mark.long


@pytest.mark.parametrize(("change", "duration"), [(0.4, 900.0), (1.0, 600.0)])
def test_soil_that_dries_for_longer_than_the_runs_last(change: float, duration: float) -> None:
    """Then only how fast it begins to dry is known, a/τ: half as much in half the time does the
    same.
    """
    concealed = make("drying_cohesion", {"change": change, "duration": duration})
    first = diagnosed(plan(seconds=60.0), [concealed]).hypotheses[0]
    assert first.effect == "drying_cohesion" and first.accepted
    for name, true in (("change", change), ("duration", duration)):
        found = first.parameters[name]
        assert abs(found.value - true) < 2.0 * found.sigma


def test_a_loss_of_torque_is_known_as_well_as_straight_lines_say() -> None:
    first = diagnosed(plan(), [make("coulomb_friction", {"loss": 0.25})]).hypotheses[0]
    loss = first.parameters["loss"]
    assert abs(loss.value - 0.25) < 3.0 * loss.sigma
    assert loss.sigma < 0.02
