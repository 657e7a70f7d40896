"""What the filter's closed forms miss of the integrals."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart


@dataclass(frozen=True)
class StressLinearisation(Effect):
    """The filter's triangular stresses stand for the true ones; this gives back what they miss.

    A₁ + s ΔA₁ … C₃ + s ΔC₃ in (20)-(22)
    Δ(θ₁, i, k, n) = the integral over the stresses of (3), (4), (7)
                     less that over the triangles of (11)-(14) with the exponent of (19)

    Acts in the on-line filter alone, through estimator/filter/shift.py, also where it is not
    configured (share 0 turns it off): simulator and diagnosis integrate (3), (4), (7) themselves.
    Source: (8)-(10) against (20)-(22), Shibly, Iagnemma, Dubowsky (2005), J. Terramechanics 42,
    1-13.
    """

    share: float = strength(
        "share of the difference given back, s", "", typical=1.0, low=0.0, high=1.0
    )

    stage = "contact"
    fingerprint = Fingerprint(
        "torque",
        "slip",
        "closed-form torque too small at low slip and deep sinkage; c seems smaller, tan φ larger",
    )
    confusable_with = told_apart(torque_constant_error="slip_step", stress_peak_shift="penetration")
    filter_only = True
