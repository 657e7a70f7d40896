"""Messages of SAE J1939: known by group and sender, whatever their priority; another sender is
told.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.can_signals import database
from gritd.drivers.framing_can import EXTENDED, REMOTE, AcceptedIdentifiers, CanFraming, pack
from tests.drivers.rig import FUZZ, can_device

GROUP = 0xFEF1  # for all; 0xEF00 is for one
DATA = bytes(range(8))


def identifier(group, address, priority=6, receiver=0):
    return priority << 26 | group << 8 | (receiver << 8 if group < 0xF000 else 0) | address


@pytest.fixture
def framing(tmp_path):
    def of(*ids, j1939=True):
        path = tmp_path / "drive.dbc"
        text = "".join(
            f'BO_ {i | 1 << 31} Drive{n}: 8 X\n SG_ Count : 0|32@1+ (1,0) [0|0] "" X\n\n'
            for n, i in enumerate(ids)
        )
        text += 'BA_DEF_ "ProtocolType" STRING ;\nBA_ "ProtocolType" "J1939";\n' * j1939
        path.write_text(text)
        keys = [f"Drive{n}.Count" for n in range(len(ids))]
        return CanFraming("bus", database(can_device(dbc=str(path)), keys), keys)

    return of


def keys(framing, *ids):
    return [frame.key for i in ids for frame in framing.decode(pack(i | EXTENDED, DATA))]


@pytest.mark.parametrize("group", [GROUP, 0xEF00])
def test_priority_and_receiver_do_not_matter_the_sender_does(framing, group):
    two = framing(identifier(group, 0x10), identifier(group, 0x11))
    came = [
        identifier(group, 0x11, priority=3, receiver=0x27),
        identifier(group, 0x10, priority=7),
        identifier(group, 0x12),
        identifier(group + 0x100, 0x10),
    ]
    assert keys(two, *came) == ["Drive1.Count", "Drive0.Count"] and two.hint == ""


def test_another_sender_is_told_until_the_stated_one_is_heard(framing):
    one = framing(identifier(GROUP, 0x10))
    assert keys(one, identifier(GROUP, 0x2A, priority=3)) == []
    assert f"0x{identifier(GROUP, 0x2A, priority=3):08X}" in one.hint
    assert f"0x{identifier(GROUP, 0x10):08X}" in one.hint
    assert keys(one, identifier(GROUP, 0x10)) and one.hint == ""


def test_where_the_sender_is_left_open_the_first_is_taken_and_a_second_told(framing):
    one = framing(identifier(GROUP, 0xFE))
    assert keys(one, identifier(GROUP, 0x2A)) and one.hint == ""
    assert keys(one, identifier(GROUP, 0x10)) == [] and "address 0x2A alone" in one.hint
    one.reset()
    assert keys(one, identifier(GROUP, 0x10))


def test_without_j1939_identifiers_are_exact_and_the_likely_one_is_told(framing):
    one = framing(identifier(GROUP, 0x10), j1939=False)
    assert keys(one, identifier(GROUP, 0x10, priority=3)) == [] and one.hint
    assert keys(one, identifier(GROUP, 0x10)) and one.hint == ""


@FUZZ
@given(st.integers(0, (1 << 29) - 1), st.booleans())
def test_a_link_lets_pass_what_its_framing_wants(can_id, remote):
    filters = [
        {"can_id": identifier(GROUP, 0x10), "can_mask": 0x3FFFF00, "extended": True},
        {"can_id": 0x100, "can_mask": (1 << 29) - 1, "extended": False},
    ]
    accepted = AcceptedIdentifiers(filters)
    group = (can_id & 0x3FFFF00) >> 8 == GROUP
    assert (can_id | EXTENDED in accepted) == group
    assert (can_id in accepted) == (can_id == 0x100)
    assert (can_id | EXTENDED | REMOTE) not in accepted and -1 not in accepted
    assert identifier(GROUP, can_id & 0xFF, priority=can_id >> 26) | EXTENDED in accepted
