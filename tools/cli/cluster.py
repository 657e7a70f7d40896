"""A dask cluster to work on.

dask exchanges pickles: whoever answers as its scheduler or its worker can run anything here. So the
cluster must prove who it is (tls://), unless the user trusts everybody on the network. A worker of
another gritd would find something else, and one that hangs nothing: both are left out, and named.
What a worker had that ends goes to the others.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import Any

from gritd import __version__
from gritd.tools.cli.command import FAILED, USAGE, CommandError
from gritd.tools.cli.optional import require

TLS = "tls://"
ANSWER = 10.0  # [s] in which a worker says what it is; it does so also while it works
LOOK = 2.0  # [s] between looks at who is there
ALONE = 60.0  # [s] without any worker before that is the end: one may be started anew

KEPT = "what was finished is kept: run it again"
Identity = tuple[str, str]  # version of gritd, of Python


@contextmanager
def cluster(address: str) -> Iterator[tuple[Executor, int]]:
    """Its workers that are like us, and how many there are. Raises CommandError where none is, and
    where none is left.
    """
    client = _client(address)
    over = Event()
    try:
        alike, others = _asked(client, address)
        executor = _Alike(client.get_executor(pure=False, **_restricted(alike, others)))
        Thread(target=_watch, args=(client, executor, others, over), daemon=True).start()
        yield executor, max(len(alike), 1)
    except CancelledError:
        raise CommandError(f"--scheduler {address}: no worker is left; {KEPT}", FAILED) from None
    except Exception as error:
        if type(error).__module__.partition(".")[0] not in ("distributed", "dask"):
            raise
        reason = f"{type(error).__name__}: {str(error).splitlines()[0]:.100}"
        raise CommandError(f"--scheduler {address}: {reason}; {KEPT}", FAILED) from None
    finally:
        over.set()
        with suppress(Exception):  # a scheduler that is gone cannot be asked
            client.close(timeout=ANSWER)


def killed_workers(error: Exception) -> bool:
    """Whether a piece of work was given up since the workers that had it ended, several times."""
    return type(error).__name__ == "KilledWorker"


class _Alike(Executor):
    """Work that is done by a worker of our version, or by none: others may come later."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def submit(self, work: Any, /, *args: Any, **more: Any) -> Future[Any]:
        return self._executor.submit(_done_alike, identity(), work, *args, **more)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._executor.shutdown(wait)


def _done_alike(ours: Identity, work: Any, *args: Any, **more: Any) -> Any:
    """Raises CommandError in a worker of another version."""
    if identity() != ours:
        raise CommandError(f"a worker has {_words(identity())}; here {_words(ours)}", FAILED)
    return work(*args, **more)


def _client(address: str) -> Any:
    require("distributed", "--scheduler")
    from distributed import Client
    from distributed.security import Security

    security = Security(require_encryption=True) if address.startswith(TLS) else None
    if security and security.get_connection_args("client")["ssl_context"] is None:
        expected = "distributed.comm.tls in dask's configuration"
        raise CommandError(
            f"--scheduler {address}: found no certificates; expected {expected}", USAGE
        )
    try:
        return Client(address, timeout="5s", security=security)
    except (OSError, ValueError, TimeoutError):
        raise CommandError(
            f"--scheduler {address}: found no scheduler; expected one that answers", FAILED
        ) from None


def identity() -> Identity:
    """What has to be the same where work is done as where it is asked for."""
    return __version__, "{}.{}".format(*sys.version_info)


def _words(one: Identity) -> str:
    return "gritd {}, Python {}".format(*one)


def _asked(client: Any, address: str) -> tuple[list[str], list[str]]:
    """The workers of our version, and the others: one of another version, or that does not answer.
    A line for each of those. Raises CommandError where there are no others than those.
    """
    found = _identities(client, list(client.nthreads()))
    others = [worker for worker, one in found.items() if one != identity()]
    for worker in others:
        one = found[worker]
        reason = f"has {_words(one)}; here {_words(identity())}" if one else "does not answer"
        print(f"gritd: note: worker {worker} is left out: {reason}", file=sys.stderr)

    if others and len(others) == len(found):
        expected = "one at least with this gritd and Python"
        raise CommandError(
            f"--scheduler {address}: found no worker to use; expected {expected}", FAILED
        )
    return [worker for worker in found if worker not in others], others


def _restricted(alike: Sequence[str], others: Sequence[str]) -> dict[str, list[str]]:
    """Who may do the work: anybody, unless there are others. A host without others is named as a
    whole: a worker that is started anew there has another address.
    """
    if not others:
        return {}
    shared = {_host(worker) for worker in others}
    return {"workers": [w if _host(w) in shared else _host(w) for w in alike]}


def _host(worker: str) -> str:
    return worker.partition("://")[2].rpartition(":")[0]


def _identities(client: Any, workers: Sequence[str]) -> dict[str, Identity | None]:
    """What each says it is; None of one that does not answer in time, or knows no gritd."""
    said: dict[str, Identity | None] = {}

    def ask(worker: str) -> None:
        with suppress(Exception):  # one without gritd cannot even read the question
            said[worker] = client.run(identity, workers=[worker])[worker]

    asking = [Thread(target=ask, args=(worker,), daemon=True) for worker in workers]
    for thread in asking:
        thread.start()
    end = time.monotonic() + ANSWER
    for thread in asking:
        thread.join(max(end - time.monotonic(), 0.0))
    return {worker: said.get(worker) for worker in workers}


def _watch(client: Any, executor: Executor, others: Sequence[str], over: Event) -> None:
    """Give up what is waited for where all workers are gone, or the scheduler is."""
    seen = time.monotonic()
    while not over.wait(LOOK):
        with suppress(Exception):
            if set(client.nthreads()) - set(others):
                seen = time.monotonic()
        if time.monotonic() - seen > ALONE:
            executor.shutdown(wait=False)
            return
