"""The loop's way to the log: ticks, readings and checkpoints handed to the writer thread."""

from __future__ import annotations

from collections.abc import Sequence

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.tick import LoopRecord, TickRow
from gritd.estimator.recording.topics import CHECKPOINT_TOPIC, LOOP_TOPIC, messages_of
from gritd.estimator.recording.writer import WriterThread


class LogSink:
    """Hands ticks to the writer thread, readings first: file order is consumption order."""

    def __init__(self, writer: WriterThread) -> None:
        self._writer = writer

    def put(self, readings: Sequence[Reading], tick: TickRow, loop: LoopRecord) -> None:
        stamp = loop.stamp
        messages = [*messages_of(tick), (LOOP_TOPIC.name, stamp, loop)]
        self._writer.put(readings, messages)

    def counts(self) -> tuple[int, int]:
        status = self._writer.status()
        return status.queued, status.dropped

    def checkpoint(self, stamp: int, configuration: str, state: str, new_part: bool) -> None:
        message = (CHECKPOINT_TOPIC.name, stamp, (stamp, configuration, state))
        if new_part:
            self._writer.begin_part(configuration, message)
        else:
            self._writer.put((), [message])
