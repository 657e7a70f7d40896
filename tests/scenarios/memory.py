"""One allocation that fails, at every place in turn (as SQLite is tested). CPython's own test
module makes it fail: memory of every kind, Python objects and raw blocks.
"""

from __future__ import annotations

from threading import Thread

import pytest

testcapi = pytest.importorskip("_testcapi", reason="this Python is without its test module")
PATIENCE = 120.0  # [s] after which what is under test hangs


def enough(prepared, run):
    """A number of allocations that suffices for run(prepared()), at most twice the least."""
    number = 16
    while number < 1 << 20:
        subject = prepared()
        testcapi.set_nomemory(number, 0)
        try:
            done = run(subject)
        except MemoryError:
            done = False
        finally:
            testcapi.remove_mem_hooks()
        if done is not False:
            return number
        number *= 2
    raise AssertionError("no number of allocations suffices")


def failing(number, run):
    """What `run` returns, or the exception it raises, where its allocation of this number fails and
    no other. In a thread of its own: it must come back.
    """
    outcome = []

    def inject():
        testcapi.set_nomemory(number, number + 1)
        try:
            found = run()
        except BaseException as error:
            found = error
        testcapi.remove_mem_hooks()
        outcome.append(found)

    thread = Thread(target=inject, daemon=True)
    thread.start()
    thread.join(PATIENCE)
    testcapi.remove_mem_hooks()
    assert not thread.is_alive(), f"hangs after allocation {number} failed"
    return outcome[0] if outcome else MemoryError()
