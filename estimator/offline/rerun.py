"""A recorded run taken through the pipeline again: ticks, and checkpoints where a part or a
configuration begins.

A checkpoint is met in one of two ways. Coming from the ticks before it, the state must be the
logged one to the bit: the change of configuration is recomputed like everything else. Coming from
nowhere (the first part kept, or messages lost before it) the logged state is where the rerun
begins.
"""

from __future__ import annotations

from collections.abc import Callable

from gritd.estimator.config.configuration import ConfigError, Configuration, loads
from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.tick import TickRow
from gritd.estimator.offline.playback import Checkpoint, RecordedTick
from gritd.estimator.online.carry import carry_over
from gritd.estimator.online.checkpoint import decode, encode
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.mcapfile import RecordingError

# What a calculation ends in that begins with numbers that do not belong together.
IMPOSSIBLE = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)


class Rerun:
    """`settings_of` gives the run's settings from a configuration."""

    def __init__(
        self, configuration: Configuration, settings_of: Callable[[Configuration], Settings]
    ) -> None:
        self._settings_of = settings_of
        self._text = configuration.text
        self.pipeline = Pipeline(settings_of(configuration))
        self._state = self.pipeline.start()
        self.known = True  # whether the state is the run's own, so that its ticks can be compared
        self._given = False  # the state came from a checkpoint: it may be anybody's

    def step(self, tick: RecordedTick) -> TickRow:
        """Raises RecordingError where a checkpoint's state leads nowhere."""
        try:
            self._state, record = self.pipeline.step(self._state, tick.readings, tick.stamp)
        except IMPOSSIBLE as error:
            if not self._given:
                raise
            reason = f"{type(error).__name__}: {error!s:.100}"
            raise RecordingError(f"/checkpoint: a state that no run comes to: {reason}") from error
        return record

    def lose(self) -> None:
        """Messages are missing from here on: until the next checkpoint the state is anybody's."""
        self.known = False

    def reconfigure(self, checkpoint: Checkpoint) -> bool:
        """Take over the checkpoint's configuration, as the daemon did; whether it is another.
        Raises RecordingError.
        """
        if checkpoint.configuration == self._text:
            return False
        configuration = _configuration(checkpoint)
        if configuration.text == self._text:  # as another version of gritd writes it
            return False

        settings = self._settings_of(configuration)
        before, self.pipeline = self.pipeline.settings, Pipeline(settings)
        self._state = carry_over(self.pipeline, self._state, before)
        self._text = configuration.text
        return True

    def checkpoint(self, stamp: int) -> Checkpoint:
        """What a recording of this rerun holds where the configuration changed."""
        return Checkpoint(stamp, self._text, encode(self._state))

    def resume(self, checkpoint: Checkpoint) -> bool:
        """Go on from the logged state; False if one that was known differs from it. Raises
        RecordingError.
        """
        self.reconfigure(checkpoint)
        same = not self.known or encode(self._state) == checkpoint.state

        try:
            self._state = decode(checkpoint.state, self.pipeline.settings)
        except ValueError as error:
            raise RecordingError(f"/checkpoint: {error}") from None

        self.known = self._given = True
        return same


def _configuration(checkpoint: Checkpoint) -> Configuration:
    """Raises RecordingError."""
    try:
        return loads(checkpoint.configuration, "/checkpoint")
    except ConfigError as error:
        raise RecordingError(str(error)) from None
