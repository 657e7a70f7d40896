from typing import Any

from numpy.typing import NDArray

from gritd.estimator.recording.message_records import Starts

Steps = tuple[tuple[int, int, int], ...]

def walk(
    content: bytes, ends: Starts, sizes: Starts, /
) -> tuple[bytes, bytes, bytes, bytes, dict[int, int]] | None: ...
def fill(
    content: bytes,
    starts: Starts,
    own: Starts,
    rows: NDArray[Any],
    reach: int,
    before: int,
    pieces: Steps,
    times: Steps,
    /,
) -> None: ...
