"""A thread that hangs is noticed by looks, not by time."""

from __future__ import annotations

from gritd.estimator.threads.pulse import Pulse, silent


def test_a_pulse_is_lost_after_its_patience_and_found_again():
    beats = [0]
    pulse = Pulse("loop", lambda: beats[0], 3)
    assert [silent([pulse]) for _ in range(4)] == ["", "", "loop", "loop"]
    beats[0] += 1
    assert silent([pulse]) == ""
