"""A first answer: what is strong is named, alone, and the answer says that it is a first one."""

from __future__ import annotations

import pytest

from gritd.estimator.effects import make
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan

pytestmark = pytest.mark.long


def test_a_first_answer_names_the_strongest_and_says_so() -> None:
    drawn = plan(seconds=12.0)
    acting = (make("sinkage_datum", {"offset": 0.004}),)
    before = TUNING.search
    rig = wheel_rig(record(drawn, acting), drawn.settings)
    found = diagnose(rig, redo={"quick": True}, quick=True)

    assert found.hypotheses[0].effect == "sinkage_datum"
    assert max(len(e.names) for e in found.explanations) == 1
    assert any("--quick" in note for note in found.caveats)
    assert before == TUNING.search
