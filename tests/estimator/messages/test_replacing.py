"""Named tuples that change a field or two."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from gritd.estimator.messages.replacing import quickly_replaced


class Slow(NamedTuple):
    a: int
    b: str = "b"
    c: tuple[int, ...] = ()


@quickly_replaced
class Quick(NamedTuple):
    a: int
    b: str = "b"
    c: tuple[int, ...] = ()


@pytest.mark.parametrize("changed", [{}, {"a": 2}, {"c": (1,), "b": "x"}])
def test_a_quick_one_is_replaced_as_any_other(changed):
    before = Quick(1)
    after = before._replace(**changed)
    assert tuple(after) == tuple(Slow(1)._replace(**changed))
    assert type(after) is Quick and before == Quick(1)


def test_an_unknown_field_is_an_error():
    with pytest.raises((KeyError, ValueError)):
        Quick(1)._replace(d=1)
