"""What the journal says of devices, where there is more to say than it may."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from gritd.drivers.reader import ReaderStats
from gritd.tools.service import journal
from gritd.tools.service.incidents import BURST
from gritd.tools.service.journal import OF_DEVICE, Journal


def test_a_count_does_not_take_the_place_of_how_the_port_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A device that comes and goes all the time, and sends something amiss as it comes back."""
    stats = ReaderStats("encoders", "OPEN", "", *(0,) * 17, "")
    reader = SimpleNamespace(device="encoders", stats=lambda: stats)
    daemon = SimpleNamespace(
        clock=SimpleNamespace(now=lambda: 0), loop=SimpleNamespace(latest=None)
    )
    said: list[str] = []
    monkeypatch.setattr(journal, "tell", lambda _, level, text: said.append(text))
    for silent in ("_queue_fell_behind", "_log", "_threads"):
        monkeypatch.setattr(Journal, silent, lambda *_: ())

    tells = Journal([reader], None, None)  # type: ignore[arg-type, list-item]
    tells(daemon)  # type: ignore[arg-type]
    for _ in range(BURST):
        for state in ("WAITING", "OPEN"):
            stats = replace(stats, state=state, last_error="gone")
            tells(daemon)  # type: ignore[arg-type]

    stats = replace(stats, state="WAITING")
    tells(daemon)  # type: ignore[arg-type]
    amiss = {name: 7 for name in OF_DEVICE}
    stats = replace(stats, state="OPEN", **amiss)
    tells(daemon)  # type: ignore[arg-type]

    daemon.clock = SimpleNamespace(now=lambda: 3 * 10**9)  # there is room again
    tells(daemon)  # type: ignore[arg-type]
    states = [line for line in said if line.startswith("device encoders ")]
    assert states[-1].startswith("device encoders OPEN")
    assert any(line.startswith("device encoders: ") for line in said)
