"""What a run of the daemon left."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager

import numpy as np

from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import TOPICS
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import replay


def recordings(path):
    return [read(part, TOPICS) for part in parts(path)]


def rows(path, topic):
    """All messages of a topic, over all parts."""
    return np.concatenate([recording.arrays(topic) for recording in recordings(path)])


def log_lines(path):
    """The texts of /log."""
    return [
        m[2][3] for recording in recordings(path) for m in recording.messages() if m[0] == "/log"
    ]


def verified(path):
    """Whether the replay of the run is identical bit for bit."""
    with silence():
        try:
            return replay.main([str(path), "--verify"]) == 0
        except CommandError as error:
            raise AssertionError(str(error)) from None


@contextmanager
def silence():
    """Standard output into nothing."""
    before = sys.stdout
    with open(os.devnull, "w", encoding="utf-8") as sys.stdout:
        try:
            yield
        finally:
            sys.stdout = before


def unreported(path):
    """Ticks that are neither there nor counted as missed."""
    stamps, missed = rows(path, "/tick")["stamp"], rows(path, "/loop")["missed"]
    gone = np.round(np.diff(stamps) / 4e6).astype(int) - 1
    return int(np.max(np.abs(np.cumsum(gone) - (missed[1:].astype(int) - int(missed[0])))))
