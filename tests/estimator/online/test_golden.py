"""The numbers of /tick change on purpose only."""

from __future__ import annotations

import json

import pytest

from gritd.estimator.messages.status import Flag
from tests.estimator.online import golden

ANEW = (
    "/tick is another: if that is meant, raise REVISION in estimator/messages/tick.py and run "
    "python -m tests.estimator.online.golden"
)


def test_the_same_readings_give_the_same_ticks_until_the_revision_is_raised():
    kept, computed = json.loads(golden.KEPT.read_text(encoding="utf-8")), golden.computed()
    assert kept["revision"] == computed["revision"], ANEW
    for name in kept.keys() - {"revision"}:
        for was, now in zip(kept[name], computed[name], strict=True):
            assert now == pytest.approx(was, rel=1e-6, abs=1e-12), f"{name}: {ANEW}"


def test_they_hold_a_change_of_the_soil():
    flags = [int(tick["flags"]) for tick in golden.computed()["more torque from 12 s on"]]
    assert any(flag & Flag.CHANGED for flag in flags)
