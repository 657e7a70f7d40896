"""A small share of `make fuzz`, with a seed of its own."""

from __future__ import annotations

import pytest

from gritd.tools.dev.fuzz import TARGETS, run

SHARE = {"configuration": 0.005, "CAN databases": 0.01, "recordings cut at every byte": 0.05}


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
@pytest.mark.long
def test_a_share_of_every_target(target, tmp_path):
    assert (
        run(target, max(1, round(target.cases * SHARE.get(target.name, 0.002))), 2, tmp_path) == 0
    )


def test_a_wrong_answer_is_found(tmp_path, capsys):
    """The harness itself: a target that answers wrongly or raises is counted and told."""
    from gritd.tools.dev.fuzz import Target

    def raising(rng):
        return "wrong" if rng.random() < 0.5 else str(1 / 0)

    assert run(Target("broken", 10, lambda folder: raising), 10, 1, tmp_path) == 10
    assert "ZeroDivisionError" in capsys.readouterr().err
