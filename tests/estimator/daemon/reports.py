"""A report of the daemon, and the status socket that publishes it."""

from __future__ import annotations

from contextlib import contextmanager

from gritd.estimator.daemon.publish import Publisher

REPORT = {
    "pid": 1,
    "uptime": 3.0,
    "healthy": True,
    "hanging": "",
    "real_time": "yes",
    "configuration": "rig.yaml",
    "status": "STARTING",
    "flags": [],
    "channels": {"wheel_encoder": "stale"},
    "tick": {},
    "loop": {"ticks": 7, "missed": 2, "lateness": 1e-4, "late_50": 1e-5},
    "queue": {"received": 5, "processed": 5, "dropped": 0, "queued": 0},
    "devices": {
        'a"b': {
            **dict.fromkeys(
                ("readings", "frames", "bad", "lost", "errors", "quarantined", "reopened"), 3
            ),
            **{"state": "WAITING", "rate": 0.0, "last_error": "cannot open"},
        }
    },
    "log": {
        "state": "writing",
        "error": "",
        "queued": 0,
        "dropped": 0,
        "written": 9,
        "files": 1,
        "file": "run.mcap",
    },
}


@contextmanager
def publishing(path):
    """A publisher of REPORT on this socket, which is gone at the end."""
    publisher = Publisher(path, lambda: REPORT)
    publisher.start()
    yield publisher
    publisher.close()
    assert not path.exists()
