"""Where many independent pieces of work are done: local processes, or a dask cluster.

dask exchanges pickles: whoever answers as its scheduler or its worker can run anything here. So the
cluster must prove who it is (tls://), unless the user trusts everybody on the network.
"""

from __future__ import annotations

import os
import signal
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import active_children, get_context
from typing import Any

from gritd.tools.cli.command import FAILED, USAGE, CommandError
from gritd.tools.cli.offspring import bind_to
from gritd.tools.cli.optional import require

TLS = "tls://"


def add_cluster(parser: ArgumentParser, condition: str = "") -> None:
    """The options that say which cluster, if any."""
    parser.add_argument(
        "--scheduler",
        metavar="tls://…",
        help=f"{condition}a dask scheduler whose workers see DIR; it can run anything here",
    )

    parser.add_argument(
        "--trust-network",
        action="store_true",
        help="with --scheduler: take tcp://, where anybody on the network may answer",
    )


def cluster_of(arguments: Namespace) -> str | None:
    """The address of the scheduler that was asked for. Raises CommandError for one that does not
    prove who it is.
    """
    address: str | None = arguments.scheduler
    if address is None or address.startswith(TLS) or arguments.trust_network:
        return address

    raise CommandError(
        f"--scheduler {address}: found no encryption; expected {TLS}…, or --trust-network, since"
        " whoever answers there can run anything here (docs/security.md)",
        USAGE,
    )


@contextmanager
def workers(jobs: int, scheduler: str | None) -> Iterator[tuple[Executor, int]]:
    """Where work is done, and by how many at a time. Raises CommandError where the cluster cannot
    be had.
    """
    if scheduler is None:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the workers: they run side by side
        with _processes(jobs) as pool:
            yield pool, jobs
        return
    with _cluster(scheduler) as client:
        yield client.get_executor(pure=False), max(len(client.nthreads()), 1)


@contextmanager
def _processes(jobs: int) -> Iterator[Executor]:
    """Workers in process groups of their own: when we are stopped, what they started stops with
    them. Where we are killed, they end as well.
    """
    ended = signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))

    try:
        with ProcessPoolExecutor(
            jobs, get_context("spawn"), initializer=_begin, initargs=(os.getpid(),)
        ) as pool:
            try:
                yield pool
            except BaseException:
                for pid in (worker.pid for worker in active_children() if worker.pid):
                    with suppress(ProcessLookupError):
                        os.killpg(pid, signal.SIGTERM)
                raise
    finally:
        signal.signal(signal.SIGTERM, ended)


def _begin(parent: int) -> None:
    os.setpgid(0, 0)
    bind_to(parent)


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
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
        client: Any = Client(address, timeout="5s", security=security)
    except (OSError, ValueError, TimeoutError):
        raise CommandError(
            f"--scheduler {address}: found no scheduler; expected one that answers", FAILED
        ) from None
    try:
        yield client
    finally:
        client.close()
