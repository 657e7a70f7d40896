"""One allocation that fails, at every place in turn (as SQLite is tested). CPython's own test
module makes it fail: memory of every kind, Python objects and raw blocks.
"""

from __future__ import annotations

import _thread

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
    outcome, gate, done = [], _thread.allocate_lock(), _thread.allocate_lock()
    gate.acquire()
    done.acquire()

    def inject():
        gate.acquire()
        testcapi.set_nomemory(number, number + 1)
        try:
            found = run()
        except BaseException as error:
            found = error
        testcapi.remove_mem_hooks()
        outcome.append(found)
        done.release()

    # whoever waits must not allocate meanwhile: the one that fails could be its own
    _thread.start_new_thread(inject, ())
    gate.release()
    came_back = done.acquire(True, PATIENCE)
    testcapi.remove_mem_hooks()
    assert came_back, f"hangs after allocation {number} failed"
    return outcome[0] if outcome else MemoryError()
