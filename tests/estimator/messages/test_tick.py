"""The table of /tick: every value stands under its own name, with its unit."""

from __future__ import annotations

from gritd.estimator.messages.tick import (
    LOOP_FIELDS,
    TICK_FIELDS,
    TICK_NAMES,
    Aid,
    FilterHealth,
    Head,
    LargestPull,
    LoopRecord,
    Measurements,
    Predictions,
    SoilEstimate,
    Tick,
    names_of,
    row,
)


def named(block, prefix=""):
    """A block that holds, in each field, the name under which it has to be recorded."""
    return block(**{name: prefix + name for name in block._fields})


def test_every_value_is_recorded_under_its_name():
    tick = Tick(
        drawbar_pull=named(Aid, "drawbar_pull_"),
        torque=named(Aid, "torque_"),
        health=named(FilterHealth),
        largest_pull=named(LargestPull),
        predictions=named(Predictions),
        soil=named(SoilEstimate),
        measurements=named(Measurements),
        head=named(Head),
    )
    assert row(tick) == TICK_NAMES == names_of(Tick)
    assert len(set(TICK_NAMES)) == len(TICK_NAMES) == 69
    assert tuple(named(LoopRecord)) == tuple(name for name, _, _ in LOOP_FIELDS)


def test_every_quantity_has_its_unit():
    for name, kind, meaning in (*TICK_FIELDS, *LOOP_FIELDS):
        assert "{" not in meaning, name
        if kind == "float64":
            assert "[" in meaning and "]" in meaning, name
