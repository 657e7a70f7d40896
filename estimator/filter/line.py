"""A stretch of steady motion as one affine measurement of the soil."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

from gritd.estimator.filter.estimate import Estimate, Matrix, Update, Vector, dot
from gritd.estimator.filter.measurement import ByParameters, Measurement
from gritd.estimator.wheel.wheel_state import WheelState


class Line(NamedTuple):
    """y = H x + noise, of m = 1 or 2 components: torque, or torque and drawbar pull."""

    y: Vector  # (m,) measured, less the tangent of the prediction at x = 0
    H: Matrix  # (m, d)
    R: Matrix  # (m, m) noise of a single window
    D: Matrix  # (m, m) of what does not average out within a stretch
    share: Vector  # (m,) r W [N·m] and W [N]: what errors of form are shares of

    def innovation(self, x: Vector) -> Vector:
        """What the vector x (d,) leaves of it (m,)."""
        return tuple([y - dot(h, x) for y, h in zip(self.y, self.H, strict=True)])

    def update(self, x: Vector, windows: int) -> Update:
        """The mean of so many windows as a measurement, about the vector x (d,)."""
        return Update(self.innovation(x), self.H, self.noise(windows))

    def noise(self, windows: int, own: float = 0.0) -> Matrix:
        """Covariance (m, m) of the mean of so many windows; own: the error of this stretch alone,
        independent for each component, in shares of the load.
        """
        noise = [
            [r / windows + d for r, d in zip(rs, ds, strict=True)]
            for rs, ds in zip(self.R, self.D, strict=True)
        ]
        for at, share in enumerate(self.share):
            noise[at][at] += (own * share) ** 2
        return tuple([tuple(row) for row in noise])

    def mixed(self, other: Line, weight: float) -> Line:
        """The mean of two, `weight` on the other."""
        keep = 1.0 - weight
        y = tuple([keep * a + weight * b for a, b in zip(self.y, other.y, strict=True)])
        H, R, D = (_mixed(a, b, weight) for a, b in zip(self[1:4], other[1:4], strict=True))
        share = tuple([keep * a + weight * b for a, b in zip(self.share, other.share, strict=True)])
        return Line(y, H, R, D, share)


def line_of(
    measurement: Measurement, mean: WheelState, by_parameters: ByParameters, x: Vector
) -> Line:
    """The mean state of a stretch, along the tangent at the vector x (d,)."""
    estimate = Estimate(x, b"")
    prediction = measurement.predict(estimate, mean)
    update = measurement.linearise(mean, prediction, estimate, by_parameters)
    y = tuple([i + dot(h, x) for i, h in zip(update.innovation, update.H, strict=True)])

    # what lags is not off by its slip alone: torque and pull each have their own error
    own = [
        hypot(quantity.by_slip * mean.doubts[0], quantity.by_load * mean.doubts[1])
        for quantity in prediction[:2]
    ]
    narrowing = mean.odometry.slopes[2] if mean.odometry else 1.0
    shared = [quantity.by_slip * mean.grain * narrowing for quantity in prediction[:2]]
    kept = measurement.kept(mean)
    lasting = _lasting([own[at] for at in kept], [shared[at] for at in kept])
    load = mean.load.value
    shares = (measurement.chain.wheel.radius * load, load)
    return Line(y, update.H, update.R, lasting, tuple([shares[at] for at in kept]))


def _lasting(own: list[float], shared: list[float]) -> Matrix:
    """Covariance (m, m) of errors of each component's own, and of one that all share."""
    return tuple(
        [
            tuple([a * b + (own[i] ** 2 if i == j else 0.0) for j, b in enumerate(shared)])
            for i, a in enumerate(shared)
        ]
    )


def _mixed(one: Matrix, other: Matrix, weight: float) -> Matrix:
    keep = 1.0 - weight
    return tuple(
        [
            tuple([keep * a + weight * b for a, b in zip(p, q, strict=True)])
            for p, q in zip(one, other, strict=True)
        ]
    )
