"""What the filter made of a recording, in a few lines: soil, status, measured against predicted."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite, isnan, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.filter.reasons import Reason
from gritd.estimator.filter.tuning import TRUST
from gritd.estimator.messages.status import UPDATED, Flag, Status
from gritd.tools.cli.wording import honesty

BELIEVED = Reason()
Rows = NDArray[np.void]  # structured: fields of /tick, one row a tick or one a window
SIDE_BY_SIDE = (("torque", "N·m"), ("drawbar_pull", "N"), ("load", "N"))


def report(path: Path, rows: Rows, each: str, reason: Reason = BELIEVED) -> str:
    """rows: fields of /tick (n,). `each` says what a row is, "ticks" or "windows"; reason: why what
    the run leaves is not believed. What the rows lack is left out.
    """
    last = {name: rows[name][-1] for name in rows.dtype.names or ()}
    seconds = (int(last["evaluated"]) - int(rows["evaluated"][0])) * 1e-9

    return "\n".join(
        [
            f"{path}: {seconds:.1f} s, {len(rows)} {each}, {int(last['updates'])} filter updates, "
            f"{int(last['resets'])} resets",
            f"  status     {_statuses(rows)}",
            f"  flags      {_flags(rows)}",
            *_window(rows, each),
            *_doubted(last, reason),
            f"  c          {last['cohesion']:.0f} ± {last['cohesion_sigma']:.0f} Pa",
            f"  tan φ      {last['tan_phi']:.4f} ± {last['tan_phi_sigma']:.4f}   correlation with "
            f"c {_correlation(last):+.3f}; weakest direction {last['separability']:.0%} of the "
            "prior's σ",
            f"  k          {last['shear_modulus'] * 1e3:.1f} ± "
            f"{last['shear_modulus_sigma'] * 1e3:.1f} mm",
            *_side_by_side(rows),
            f"  σ          {_honesty(float(last['consistency']))}",
        ]
    )


def _honesty(consistency: float) -> str:
    """What the innovations say of σ."""
    words = honesty(consistency)
    if not isfinite(consistency):
        return words
    return (
        f"{words}: innovations squared over their variance {consistency:.2f} in the last 2 s "
        f"(1 where σ is honest, above {TRUST.mismatch:g} the model disagrees)"
    )


def _statuses(rows: Rows) -> str:
    values, counts = np.unique(rows["status"], return_counts=True)
    shares = sorted(zip(counts.tolist(), values.tolist(), strict=True), reverse=True)
    return ", ".join(
        f"{Status(int(value)).name} {count / len(rows):.0%}" for count, value in shares
    )


def _flags(rows: Rows) -> str:
    """How much of the recording each flag was raised."""
    raised = {flag: np.mean(rows["flags"].astype(int) & flag > 0) for flag in Flag if flag}
    return (
        ", ".join(f"{flag.name} {share:.0%}" for flag, share in raised.items() if share > 0.0)
        or "none"
    )


def _window(rows: Rows, each: str) -> Iterator[str]:
    """The length of the windows, from one to the next."""
    if each == "windows" and len(rows) > 1:
        yield f"  window     {np.median(np.diff(rows['evaluated'])) * 1e-9:g} s"


def _doubted(last: dict[str, float], reason: Reason) -> Iterator[str]:
    """That the soil at the end is the stated one; why what is there is not believed."""
    if reason.why:
        yield f"  belief     not believed: {reason}"
    if int(last["flags"]) & Flag.PRIOR:
        yield "  soil       the prior: the filter's own estimate is not believed at the end"


def _correlation(row: dict[str, float]) -> float:
    product = row["cohesion_sigma"] * row["tan_phi_sigma"]
    return row["cov_c_tan_phi"] / product if product else 0.0


def _side_by_side(rows: Rows) -> Iterator[str]:
    """Measured and predicted torque, drawbar pull and load while tracking."""
    tracking, names = rows[np.isin(rows["status"], UPDATED)], rows.dtype.names or ()
    for name, unit in SIDE_BY_SIDE:
        if not len(tracking) or f"{name}_predicted" not in names or isnan(tracking[name].mean()):
            continue

        measured, predicted = tracking[name], tracking[f"{name}_predicted"]
        difference = sqrt(np.mean((measured - predicted) ** 2))
        sigma = (
            f" ± {tracking[f'{name}_predicted_sigma'].mean():.3f}"
            if f"{name}_predicted_sigma" in names
            else ""
        )
        yield (
            f"  {name.replace('_', ' '):13}measured {measured.mean():7.3f} {unit}, "
            f"predicted {predicted.mean():7.3f}{sigma}, rms difference {difference:.3f}"
        )
