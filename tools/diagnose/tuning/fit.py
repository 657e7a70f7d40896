"""Tuned numbers of tools/diagnose/fit: the fit, its random effects, and evidence about it."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned

FORM_SIZES = (0.0, 0.003, 0.01, 0.03, 0.1, 0.3)
FORM_PRIOR = (0.12, 0.12, 0.14, 0.22, 0.28, 0.12)
DRIVE_SIZES = (0.0, 0.003, 0.01, 0.03, 0.1)
DRIVE_PRIOR = (0.3, 0.25, 0.25, 0.15, 0.05)
PUBLISHED = "judgement: docs/diagnosis.md, Discrepancy of form"
FORMS = "differences of published formulas"


@dataclass(frozen=True)
class FitTuning:
    """How a model is fitted to the recordings, and how far it may be off."""

    # --- base.py ---
    tolerance: float = tuned(
        5e-4, "-", "of a channel's size: integration rules and idealised servos are off by it"
    )

    rough_rounds: int = tuned(3, "rounds", "of the first fit, whose only use is to linearise")

    # --- form_error.py: how far published forms of an effect differ ---
    form_error_sizes: tuple[float, ...] = tuned(
        (0.0, 0.05, 0.15, 0.4), "-", "shares of an effect", FORMS
    )
    form_error_prior: tuple[float, ...] = tuned(
        (0.2, 0.3, 0.35, 0.15), "prior", "probability of each of the sizes", FORMS
    )

    place_waves: int = tuned(24, "cosines", "along the bed by which an effect may vary")
    place_sizes: tuple[float, ...] = tuned(
        (0.0, 0.1, 0.3), "-", "shares of an effect that vary along the bed"
    )
    place_prior: tuple[float, ...] = tuned(
        (0.8, 0.1, 0.1), "prior", "probability of each of the sizes"
    )

    profile_sizes: tuple[float, ...] = tuned(
        (0.0, 0.1, 0.5, 2.0), "-", "of an effect, over what no law says how it goes"
    )
    harmonics: int = tuned(4, "-", "of a ripple that it may have besides")
    following_arcs: tuple[float, ...] = tuned(
        (0.3, 1.0, 3.0), "rad", "of rolling over which an effect follows: the contact and more"
    )

    # --- discrepancy.py ---
    form_sizes: tuple[float, ...] = tuned(
        FORM_SIZES, "-", "of a channel's size: what a model of a wheel in soil misses", PUBLISHED
    )
    form_prior: tuple[float, ...] = tuned(
        FORM_PRIOR, "prior", "probability of each: half of it is at 3 and 10 %", PUBLISHED
    )
    drive_sizes: tuple[float, ...] = tuned(
        DRIVE_SIZES, "-", "of a channel's size: what a model of a drive misses"
    )
    drive_prior: tuple[float, ...] = tuned(DRIVE_PRIOR, "prior", "probability of each of the sizes")
    form_features: int = tuned(72, "features", "of a source at most", "run time")
    form_features_shared: int = tuned(
        180,
        "features",
        "of a source at most, with a reference campaign: it follows every transient that both have",
    )
    form_left_out: float = tuned(3e-3, "-", "variance of the discrepancy that may be left out")
    form_apart: int = tuned(
        2,
        "sizes",
        "by which the discrepancies of two channels may differ where the soil is known: ten times",
        PUBLISHED,
    )
    form_turn: float = tuned(
        0.2, "-", "size of what goes with the wheel's angle, in that of the discrepancy"
    )
    form_harmonics: tuple[float, ...] = tuned(
        (1.0, 2.0), "choice", "a turn: of what goes with the wheel's angle; higher: listed effects"
    )

    # --- evidence.py ---
    strength_sizes: tuple[float, ...] = tuned(
        (0.1, 0.3, 1.0, 3.0), "-", "sizes of a strength tried, in units of the expected one"
    )

    # --- functions.py ---
    misfit_size: float = tuned(
        0.03, "-", "of the channel's size: expected size of a misfit without a name"
    )
    waves: int = tuned(4, "cosines", "along time or place")
    varies: float = tuned(1e-3, "-", "relative spread below which a covariate does not vary")
    outlying: float = tuned(4.0, "σ", "a standardised covariate is cut beyond it")
    cosines: int = tuned(2, "cosines", "by which a share of an effect may vary along time or place")

    # --- heldout.py ---
    folds: int = tuned(3, "parts", "of which each is predicted by the others, where runs are fewer")
    bands: int = tuned(3, "bands", "of slip and of load that are held out")
    band_spread: float = tuned(0.05, "-", "relative spread below which there are no bands")

    # --- marginal.py, model.py ---
    last_step: float = tuned(0.3, "nats", "that the evidence may count beyond where a fit stands")

    # --- problem.py ---
    far: float = tuned(8.0, "σ", "constants are kept this close to what is known of them")
    strength_prior: float = tuned(
        3.0, "-", "a strength's prior standard deviation, in expected sizes"
    )

    # --- shared.py: what the reference shows already ---
    shared_sizes: tuple[float, ...] = tuned(
        (0.0, 0.3, 1.0, 3.0), "expected sizes", "of the library's effects in both campaigns"
    )

    # --- signatures.py ---
    most_orders: int = tuned(120, "orders", "tried at most", "run time")
    derivative_steps: tuple[float, ...] = tuned(
        (1.0, 0.1, 0.01), "choice", "of an expected size, the next where the effect runs away"
    )
    relative_times: tuple[float, ...] = tuned(
        (0.1, 0.3, 1.0, 3.0), "-", "time constants tried, of the campaign's or the run's length"
    )
    shape_known: float = tuned(0.4, "-", "relative σ of a shape from which three values are tried")
    shape_factors: tuple[float, ...] = tuned(
        (0.4, 1.0, 2.0), "choice", "values of a shape tried, of its expected one"
    )
    patch_lengths: tuple[float, ...] = tuned(
        (0.12, 0.25, 0.5, 0.75), "share", "of the bed that was driven: lengths tried"
    )
    patch_centres: int = tuned(13, "places", "along the bed that are tried")
