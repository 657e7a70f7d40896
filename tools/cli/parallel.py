"""The same work for many items on all cores, and work that is done meanwhile: children are forked,
so what the work needs is there already.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from gritd.tools.cli.offspring import ends_with_us

Item = TypeVar("Item")
Made = TypeVar("Made")

ENDED = "a child process ended before its work was done"

_work: Callable[[Any], Any] | None = None  # what the children find when they are forked


def each(jobs: int, work: Callable[[Item], Made], items: Sequence[Item]) -> list[Made]:
    """`work` of every item, in order. The result must be picklable, `work` and the items need not
    be. Raises what `work` raised, and ChildProcessError where a child ended otherwise: a Pool would
    begin another child in its place for ever.
    """
    if jobs < 2 or len(items) < 2:
        return [work(item) for item in items]

    global _work
    # a closure is the point: it is inherited, never pickled
    _work = lambda place: work(items[place])  # noqa: E731
    try:
        fork = multiprocessing.get_context("fork")
        count = min(jobs, len(items))
        with ProcessPoolExecutor(count, fork, initializer=ends_with_us()) as pool:
            return list(pool.map(_forked, range(len(items))))
    except BrokenProcessPool:
        raise ChildProcessError(ENDED) from None
    finally:
        _work = None


def _forked(place: int) -> Any:
    assert _work is not None
    return _work(place)


@contextmanager
def meanwhile(jobs: int, work: Callable[[], Made]) -> Iterator[Callable[[], Made]]:
    """What gives the result of `work`, which a child does meanwhile where there is more than one
    job. The result must be picklable. Raises what `work` raised, when asked for the result.
    """
    if jobs < 2:
        made = work()
        del work  # it may hold much
        yield lambda: made
        return

    fork = multiprocessing.get_context("fork")
    ours, theirs = fork.Pipe(duplex=False)
    child = fork.Process(target=_sent, args=(theirs, work, ends_with_us()), daemon=True)
    child.start()
    theirs.close()
    del work
    try:
        yield lambda: _received(ours)
    finally:
        child.terminate()
        child.join()
        ours.close()


def _sent(to: Connection, work: Callable[[], Any], begin: Callable[[], None]) -> None:
    begin()
    try:
        to.send((work(), None))
    except Exception as error:
        to.send((None, error))


def _received(ours: Connection) -> Any:
    try:
        made, error = ours.recv()
    except EOFError:
        raise ChildProcessError(ENDED) from None
    if error is not None:
        raise error
    return made
