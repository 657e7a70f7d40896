"""Where the misfit lives: channel by covariate, with its share, its chance, and a sentence with numbers."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from estimator.terramechanics.soil import Array
from tools.diagnose.noise import whiten
from tools.diagnose.result import Location
from tools.diagnose.rig import Stack
from tools.diagnose.screen import whitened
from tools.diagnose.select import Model, Search
from tools.diagnose.signatures import highest_order

DISCOVERY = 0.05  # false-discovery rate of the list
MOST = 8
RIPPLE = 0.01  # chance of the strongest order by noise alone
FAR = 3.0  # [σ]
STRAINED = {
    "scale": "constant",
    "offset": "constant",
}  # what of a channel's calibration, and the covariate it stands for
LEAST = 0.05  # share below which a place is not worth naming
WORDS = {
    "slip": "slip", "speed": "rim speed [m/s]", "load": "load [N]", "sinkage": "sinkage [m]", "position": "place [m]",
    "time": "time [s]", "heat": "∫I² [A²s]", "acceleration": "acceleration [rad/s²]", "wheel_angle": "wheel angle",
}  # fmt: skip


def locate(search: Search, model: Model) -> tuple[Location, ...]:
    """Places of the misfit of a model, by share; only those that survive false-discovery control."""
    stack = search.problem.stack
    base, (noise, strain) = model.fitted.base(), search.draws
    ready = whitened(search.problem.noise, search.generics)
    columns = np.column_stack([w.columns for w in ready])
    a, b = base.projected(columns)
    null = base.scores(columns, noise, np.resize(strain, (base.jacobian.shape[1], strain.shape[1])))
    ends = np.cumsum([w.columns.shape[1] for w in ready])
    own = [slice(end - w.columns.shape[1], end) for w, end in zip(ready, ends, strict=True)]
    gain = [_gain(a[s, s], b[s], null[s]) for s in own]
    names = [w.signature.name.partition("~") for w in ready]
    channels = [channel for channel, _, _ in names]
    whole = {c: _whole(a, b, null, [s for s, d in zip(own, channels, strict=True) if d == c]) for c in set(channels)}
    alone = {(c, n): g[0] for (c, _, n), g in zip(names, gain, strict=True)}
    q = _false_discovery(np.array([g[1] for g in gain]))
    found = []
    for (channel, _, name), (value, p_i), q_i in zip(names, gain, q, strict=True):
        share = float(np.clip(value / max(whole[channel], 1e-9), 0.0, 1.0))
        if q_i <= DISCOVERY and share >= LEAST:
            covariate = max(name.split("·"), key=lambda n: alone.get((channel, n), 0.0))
            where = sentence(stack, model, channel, name)
            found.append((value, Location(channel, covariate, share, float(p_i), float(q_i), where)))
    found += _strains(stack, model) + ripples(search, model)
    found.sort(key=lambda item: -item[0])
    return tuple({(place.channel, place.covariate): place for _, place in reversed(found)}.values())[::-1][:MOST]


def ripples(search: Search, model: Model) -> list[tuple[float, Location]]:
    """The strongest order of the wheel angle in each channel, against the strongest of every surrogate."""
    stack = search.problem.stack
    orders = np.arange(3.0, highest_order(stack))
    if not orders.size:
        return []
    phase = np.outer(stack.covariate("wheel_angle"), orders)
    moving = np.where(stack.covariate("speed") > 0.0, 1.0, 0.0)[:, None]
    waves = moving * np.exp(1j * phase)
    found = []
    for channel in stack.rig.channels:
        own = stack.of(channel)[:, None]
        both = [whiten(search.problem.noise, np.where(own, part, 0.0)) for part in (waves.real, waves.imag)]
        size = np.maximum(sum(np.sum(part**2, axis=0) for part in both), 1e-12)
        gain, nulls = (
            sum((part.T @ values) ** 2 for part in both) / (size if values.ndim == 1 else size[:, None])
            for values in (model.fitted.residual, search.draws[0])
        )
        best = int(np.argmax(gain))
        p = float((1 + np.sum(nulls.max(axis=0) >= gain[best])) / (1 + nulls.shape[1]))
        if p <= RIPPLE:
            found.append((float(gain[best]), _ripple(stack, model, channel, float(orders[best]), p)))
    return found


def _ripple(stack: Stack, model: Model, channel: str, order: float, p: float) -> Location:
    own = stack.of(channel)
    residual = (stack.measured - model.fitted.predicted)[own]
    angle = stack.covariate("wheel_angle")[own]
    amplitude = 2.0 * abs(np.mean((residual - residual.mean()) * np.exp(-1j * order * angle)))
    share = float(np.clip(0.5 * amplitude**2 / max(float(np.var(residual)), 1e-300), 0.0, 1.0))
    where = f"{channel}: ripples {order:.0f} times a turn, ± {amplitude:.2g} {stack.rig.units[channel]}"
    return Location(channel, "wheel_angle", share, p, p, where)


def _strains(stack: Stack, model: Model) -> list[tuple[float, Location]]:
    """Calibration constants pulled far off what is known: a misfit that hides there leaves no residual."""
    nats = 0.5 * model.fitted.u**2
    found = []
    for known, u, value in zip(stack.rig.constants, model.fitted.u.tolist(), nats.tolist(), strict=True):
        channel, _, what = known.name.rpartition("_")
        if channel in stack.rig.channels and what in STRAINED and abs(u) > FAR:
            to = f"{known.of(u):+.3g} {known.unit}"
            where = f"{channel}: the fit pulls its {what} {u:+.1f} σ off the calibration, to {to}"
            p = float(2.0 * norm.sf(abs(u)))
            place = Location(channel, STRAINED[what], value / float(nats.sum()), p, p, where.rstrip())
            found.append((value, place))
    return found


def _gain(a: Array, b: Array, null: Array) -> tuple[float, float]:
    """Nats gained beyond chance, and the chance of as much."""
    smooth = np.linalg.inv(a + np.eye(len(b)))
    value, nulls = 0.5 * float(b @ smooth @ b), 0.5 * np.sum(null * (smooth @ null), axis=0)
    return max(value - float(nulls.mean()), 0.0), float((1 + np.sum(nulls >= value)) / (1 + nulls.size))


def _whole(a: Array, b: Array, null: Array, parts: list[slice]) -> float:
    index = np.concatenate([np.arange(s.start, s.stop) for s in parts])
    return _gain(a[np.ix_(index, index)], b[index], null[index])[0]


def _false_discovery(p: Array) -> Array:
    """Adjusted p-values (Benjamini and Hochberg 1995, J. R. Stat. Soc. B 57, 289-300)."""
    order = np.argsort(p)
    ranked = p[order] * len(p) / np.arange(1, len(p) + 1)
    out = np.empty_like(p)
    out[order] = np.minimum(np.minimum.accumulate(ranked[::-1])[::-1], 1.0)
    return out


def sentence(stack: Stack, model: Model, channel: str, covariate: str) -> str:
    """Measured less predicted in words, at the low and the high end of the covariate."""
    own = stack.of(channel)
    residual = (stack.measured - model.fitted.predicted)[own]
    unit = stack.rig.units[channel]
    name = covariate.split("·")[0]
    size = f"{float(np.sqrt(np.mean(residual**2))):.3g} {unit} r.m.s."
    if name == "constant":
        return f"{channel}: measured less predicted is {residual.mean():+.3g} {unit} on average"
    if name == "run":
        means = {stack.rig.runs[r].name: residual[stack.run[own] == r].mean() for r in np.unique(stack.run[own])}
        return (
            f"{channel}: differs from run to run: " + ", ".join(f"{n} {m:+.2g}" for n, m in means.items()) + f" {unit}"
        )
    if name in ("wheel_angle", "direction") or "·" in covariate:
        return f"{channel}: varies with {covariate.replace('·', ' and ')}, {size}"
    x = stack.covariate(name)[own]
    low, high = np.quantile(x, (0.15, 0.85))
    first, last = residual[x <= low].mean(), residual[x >= high].mean()
    ends = f"{first:+.3g} {unit} at {low:.3g} to {last:+.3g} {unit} at {high:.3g}"
    return f"{channel}: measured less predicted goes from {ends} of {WORDS.get(name, name)}"
