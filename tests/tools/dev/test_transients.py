"""What the blur hides of effects that show at changes of the motion."""

from __future__ import annotations

from gritd.tools.dev.transients import standing
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


def test_the_blur_hides_some_of_a_latency_and_little_of_what_follows_over_travel() -> None:
    seen = standing(WheelRig(record(plan(), ()), settings()))
    latency, sharp = seen["sensor_latency"]
    assert latency < sharp < 2.0 * latency
    relaxed, sharp = seen["contact_relaxation"]
    assert relaxed <= sharp < 1.2 * relaxed
