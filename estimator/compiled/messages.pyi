from typing import Any

from numpy.typing import NDArray

from gritd.estimator.recording.message_records import Starts

Steps = tuple[tuple[int, int, int], ...]

def chunks(
    data: memoryview, origin: int, most: int, indexes: int, /
) -> list[tuple[int, int, int, int, int]]: ...
def walk(
    content: bytes | memoryview, ends: Starts, sizes: Starts, /
) -> tuple[bytes, bytes, bytes, dict[int, tuple[int, int, int]], bool] | None: ...
def fill(
    content: bytes | memoryview,
    starts: Starts,
    own: Starts,
    rows: NDArray[Any],
    reach: int,
    before: int,
    pieces: Steps,
    times: Steps,
    /,
) -> None: ...
