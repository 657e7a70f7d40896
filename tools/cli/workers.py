"""Where many independent pieces of work are done: local processes, or a dask cluster."""

from __future__ import annotations

import os
import signal
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import active_children, get_context

from gritd.tools.cli.cluster import TLS, cluster
from gritd.tools.cli.command import FAILED, USAGE, CommandError
from gritd.tools.cli.offspring import bind_to

WORKER_ENDED = (
    "a worker process was killed, perhaps for want of memory: expected room for all of --jobs"
)


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
    with cluster(scheduler) as (executor, width):
        yield executor, width


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
            except BrokenProcessPool:
                raise CommandError(WORKER_ENDED, FAILED) from None
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
