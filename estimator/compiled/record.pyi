from gritd.estimator.filter.estimate import Matrix, Vector
from gritd.estimator.filter.line import Line

def evidence(
    x: Vector,
    P: Matrix,
    cross: Matrix,
    variances: Vector,
    spread: Vector,
    lines: list[Line],
    windows: list[int],
    /,
) -> tuple[Vector, Vector]: ...
