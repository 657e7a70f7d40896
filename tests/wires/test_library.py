"""Every recorded session gives what it gave: a change of the drivers or the filter that touches
one is seen, and reviewed.
"""

from __future__ import annotations

import pytest

from tests.wires.library import FOLDER, differences, outcome, session, sessions

LARGEST = 100_000  # [bytes] of a session in the repository


@pytest.mark.parametrize("name", [one.name for one in sessions()])
def test_a_session_gives_what_it_gave(tmp_path, name):
    recorded = session(name)
    recorded.unpack(tmp_path)
    found = list(differences(recorded.outcome, outcome(recorded, tmp_path)))
    assert not found, "\n".join([f"{name}: {recorded.about}", *found])


def test_the_library_is_there_and_compact():
    assert len(sessions()) >= 12
    for one in sessions():
        assert sum(path.stat().st_size for path in one.folder.iterdir()) < LARGEST, one.name
        assert {path.name for path in one.folder.iterdir()} == {
            "session.json", "encoders.wire.xz", "bus.wire.xz",
        }  # fmt: skip
    assert {path.name for path in FOLDER.iterdir()} == {one.name for one in sessions()}


def test_good_sessions_lose_nothing_and_bad_ones_say_so():
    """What the names promise stands in the outcomes."""
    reported = {one.name: one.outcome for one in sessions()}
    for name in ("good-slcan", "good-multicast", "good-ascii", "wraps"):
        devices = reported[name]["devices"]
        assert not devices["encoders"].keys() - {"good", "unknown"}, name
        assert reported[name]["last"]["updates"] > 5 and reported[name]["last"]["jumps"] == 0, name
    for name, count in {
        "noise": "garbage", "flipped-bits": "bad", "garbage-8-mb": "garbage",
        "clock-step": "clock_steps", "wrong-stamps": "mistimed", "frames-lost": "lost",
        "frames-twice": "duplicates", "silence-16-bit": "turns_unknown",
    }.items():  # fmt: skip
        assert reported[name]["devices"]["encoders"][count], name
    assert reported["garbage-8-mb"]["devices"]["encoders"]["garbage"] > 7_500_000
    assert reported["no-numbers"]["devices"]["bus"]["quarantined"]
    assert reported["random-counter"]["last"]["jumps"] > 100
    late = reported["wrench-late"]
    assert late["channels"]["wrench"]["longest_gap"] < 8.0, "by its own clock, not by receipt"
    assert not late["devices"]["bus"].keys() - {"good", "unknown", "lost", "incomplete"}
    assert reported["frozen-pot"]["stuck"].keys() == {"sinkage_pot"}
