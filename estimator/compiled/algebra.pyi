from gritd.estimator.filter.estimate import Matrix, Vector

def dot(a: Vector, b: Vector, /) -> float: ...
def variance(P: Matrix, cross: Matrix, variances: Vector, h: Vector, g: Vector, /) -> float: ...
def update(
    x: Vector,
    P: Matrix,
    cross: Matrix,
    variances: Vector,
    innovation: Vector,
    H: Matrix,
    G: Matrix,
    R: Matrix,
    states: int,
    /,
) -> tuple[Vector, Matrix, Matrix]: ...
