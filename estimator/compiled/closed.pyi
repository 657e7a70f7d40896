from gritd.estimator.filter.model import PredictedQuantity

Range = tuple[float, float]

class Closed:
    def __init__(
        self,
        quantity: type[PredictedQuantity],
        wheel: tuple[float, float, float, float],  # r [m], b [m], c₁, c₂
        ln_k: float,  # at which the table was made
        theta_1: Range,  # of the table [rad]
        slip: Range,
        table: object,  # contiguous (14, 14, 56) float64, or None for no shift
        /,
    ) -> None: ...
    def predict(
        self,
        c: float,
        tan_phi: float,
        k: float,
        theta_1: float,
        slip: float,
        load: float,
        exponent: float,
        c1: float,
        c2: float,
        /,
    ) -> tuple[PredictedQuantity, PredictedQuantity, PredictedQuantity] | None: ...
    def load(
        self,
        c: float,
        tan_phi: float,
        k: float,
        theta_1: float,
        slip: float,
        sigma_m: float,
        exponent: float,
        c1: float,
        c2: float,
        /,
    ) -> float | None: ...
