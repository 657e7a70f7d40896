from gritd.estimator.filter.estimate import Vector
from gritd.estimator.filter.line import Line

def evidence(
    x: Vector,
    P: bytes,
    spread: Vector,
    lines: list[Line],
    windows: list[int],
    own: float,
    /,
) -> tuple[Vector, Vector]: ...
