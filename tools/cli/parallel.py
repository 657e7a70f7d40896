"""The same work for many items on all cores, and work that is done meanwhile: children are forked,
so what the work needs is there already.
"""

from __future__ import annotations

import io
import multiprocessing
import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from gritd.tools.cli.memory import is_scarce
from gritd.tools.cli.offspring import ends_with_us

Item = TypeVar("Item")
Made = TypeVar("Made")

ENDED = "a child process ended before its work was done"

_work: Callable[[Any], Any] | None = None  # what the children find when they are forked


def each(
    jobs: int,
    work: Callable[[Item], Made],
    items: Sequence[Item],
    kept: Sequence[object] = (),
    done: Callable[[int], None] = lambda count: None,
) -> list[Made]:
    """`work` of every item, in order; in this process alone where memory is scarce. The result must
    be picklable, `work` and the items need not be. Raises what `work` raised, and ChildProcessError
    where a child ended otherwise: a Pool would begin another child in its place for ever.

    kept: large objects that results hold and that are here already. They come back as they are
    here, not as copies. done: is given how many are.
    """
    if jobs < 2 or len(items) < 2 or is_scarce():
        return _counted((work(item) for item in items), done)

    global _work
    # a closure is the point: it is inherited, never pickled
    _work = lambda place: _packed(work(items[place]), kept)  # noqa: E731
    try:
        fork = multiprocessing.get_context("fork")
        count = min(jobs, len(items))
        with ProcessPoolExecutor(count, fork, initializer=ends_with_us()) as pool:
            made = pool.map(_forked, range(len(items)))
            return _counted((_unpacked(one, kept) for one in made), done)
    except BrokenProcessPool:
        raise ChildProcessError(ENDED) from None
    finally:
        _work = None


def _counted(made: Iterable[Made], done: Callable[[int], None]) -> list[Made]:
    every: list[Made] = []
    for one in made:
        every.append(one)
        done(len(every))
    return every


class _Pickler(pickle.Pickler):
    """Tells of kept objects only which they are."""

    def __init__(self, to: io.BytesIO, kept: Sequence[object]) -> None:
        super().__init__(to, pickle.HIGHEST_PROTOCOL)
        self._places = {id(one): place for place, one in enumerate(kept)}

    def persistent_id(self, obj: object) -> int | None:
        return self._places.get(id(obj))


class _Unpickler(pickle.Unpickler):
    """Finds them again."""

    def __init__(self, read: io.BytesIO, kept: Sequence[object]) -> None:
        super().__init__(read)
        self._kept = kept

    def persistent_load(self, pid: int) -> object:
        return self._kept[pid]


def _packed(made: object, kept: Sequence[object]) -> bytes:
    to = io.BytesIO()
    _Pickler(to, kept).dump(made)
    return to.getvalue()


def _unpacked(packed: bytes, kept: Sequence[object]) -> Any:
    return _Unpickler(io.BytesIO(packed), kept).load()


def _forked(place: int) -> Any:
    assert _work is not None
    return _work(place)


@contextmanager
def meanwhile(jobs: int, work: Callable[[], Made]) -> Iterator[Callable[[], Made]]:
    """What gives the result of `work`, which a child does meanwhile where there is more than one
    job and memory is not scarce. The result must be picklable. Raises what `work` raised, when
    asked for the result.
    """
    if jobs < 2 or is_scarce():
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
