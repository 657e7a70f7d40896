"""The same work for many items on all cores: children are forked, so what the work needs is there
already.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from gritd.tools.cli.offspring import ends_with_us

Item = TypeVar("Item")
Made = TypeVar("Made")

_work: Callable[[Any], Any] | None = None  # what the children find when they are forked


def each(jobs: int, work: Callable[[Item], Made], items: Sequence[Item]) -> list[Made]:
    """`work` of every item, in order. The result must be picklable, `work` and the items need not
    be.
    """
    if jobs < 2 or len(items) < 2:
        return [work(item) for item in items]

    global _work
    # a closure is the point: it is inherited, never pickled
    _work = lambda place: work(items[place])  # noqa: E731
    try:
        fork = multiprocessing.get_context("fork")
        with fork.Pool(min(jobs, len(items)), initializer=ends_with_us()) as pool:
            return pool.map(_forked, range(len(items)), chunksize=1)
    finally:
        _work = None


def _forked(place: int) -> Any:
    assert _work is not None
    return _work(place)
