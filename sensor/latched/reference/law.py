"""The exact distribution of an interval's threshold in float64, and its error.

All tiers take the quantile of the same random word. With shot noise alone the threshold is
Gamma(Q), with threshold noise alone it is normal, and the sum of both has no inverse in closed form
(`mixed_quantiles`). Inversion takes a microsecond a draw, so Gamma(Q) and the sum are inverted at
nodes of the normal score, in which they are nearly linear, and interpolated between them. A word w
stands for the probability (w + 1/2) / 2^32. Beyond the median the probability is counted from the
upper end, as in the table of the exact tier (sensor/latched/pixel/interval.py), so both tails keep
their digits. A draw evaluates a cubic in this probability, in cells of which each octave has as
many: a normal score for each draw would take longer than all else in the loop of the reference.

Compiled loops call special functions of scipy by address, so that numba can cache these loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import njit, types
from numba.extending import get_cython_function_address, intrinsic

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from cosim.compute.table_cache import cached_table
from sensor.latched.setting import CameraSetting

Values = npt.NDArray[np.float64]
LEAST: Final = 2.0**-40
"""Lowest threshold in electrons, as in the exact tier. It prevents an endless burst of spikes."""
_FIXED, _GAMMA, _NORMAL, _TABLE = 0, 1, 2, 3
_LEAST_TABLED: Final = 5.0
"""Threshold in electrons below which Gamma(Q) is inverted for each draw. The lower tail of smaller
thresholds spans many decades, in which a cubic would lose digits. At 5 and 20 000 electrons the
table agrees with scipy's inverse to 2e-14 and 1e-15 of the threshold."""
_SCORE: Final = 6.5
"""Range of normal scores; those of 32-bit words end at 6.34."""
_NODES: Final = 261
"""Scores at which the sum of both noises is inverted; 3 times as many up to 10 electrons, where it
is less linear."""
_MISSED: Final = 1e-2
"""Normal score by which no quantile may be off. They are off by 1e-8 at most where they were
checked, and by 1e-3 where scipy's incomplete gamma function is (interval.py)."""
_SHARED: Final = 9
"""Bits of the probability that number the cells of an octave. A cubic in each cell adds an error of
2e-13 standard deviations of the threshold at most."""
_OCTAVES: Final = 32
DRAWS = 256
"""Number of thresholds that are compared with their distribution."""


@dataclass(frozen=True, eq=False)
class Law:
    """Distribution of a threshold, in the form that compiled loops take.

    Attributes:
        kind: 0 constant, 1 gamma, 2 normal, 3 tabulated: gamma, or sum of gamma and normal.
        q: mean threshold, electrons.
        sigma: threshold noise, electrons.
        table: (2, cells, 4) coefficients of a cubic in each cell of the probability, counted from
            the lower and from the upper end, for kind 3 only.
        functions: (3,) int64, addresses of gammaincinv, gammainccinv and ndtri.
    """

    kind: int
    q: float
    sigma: float
    table: Values
    functions: npt.NDArray[np.int64]


@lru_cache(maxsize=8)
def law_of(q: float, sigma: float = 0.0, shot: bool = True, shift: float = 0.0) -> Law:
    """Distribution of G + Normal(0, sigma) + shift; G is Gamma(q) with shot noise, else the
    constant q."""
    functions = np.array([address(f) for f in ("gammaincinv", "gammainccinv", "ndtri")], np.int64)
    table = np.zeros((2, 0, 4))
    if shot:
        kind = _TABLE if sigma > 0 or shift or q >= _LEAST_TABLED else _GAMMA
    else:
        kind = _NORMAL if sigma > 0 else _FIXED
    if kind == _TABLE:
        table = _table(cached_table("law", (q, sigma), (__file__,), lambda: _edges(q, sigma)))
        table[..., 0] += shift
    return Law(kind, q + shift, sigma, table, functions)


@njit(cache=True, error_model="numpy", nogil=True)
def draw(kind, q, sigma, table, functions, word):  # type: ignore[no-untyped-def]
    """Threshold in electrons of a random word below 2^32. Arguments: see `Law`."""
    if kind == 0:
        return max(q, 2.0**-40)
    upper = word >> 31
    near = 0xFFFFFFFF - word if upper else word
    if kind == 3:
        # 2^33 times the probability from the nearer end, as a float: its exponent and the next bits
        # number the cell, and the others are the place in it.
        bits = np.float64(2 * near + 1).view(np.int64)
        cell = table[upper, (bits >> (52 - _SHARED)) - (1023 << _SHARED)]
        u = (bits & ((1 << (52 - _SHARED)) - 1)) * 2.0 ** (_SHARED - 52)
        return max(cell[0] + u * (cell[1] + u * (cell[2] + u * cell[3])), 2.0**-40)
    p = (near + 0.5) * 2.0**-32
    if kind == 1:
        return max(call_two(functions[1 if upper else 0], q, p), 2.0**-40)
    score = call_one(functions[2], p)
    return max(q + sigma * (-score if upper else score), 2.0**-40)


def draw_all(law: Law, words: npt.NDArray[np.uint32]) -> Values:
    """Thresholds of random words, (n,) electrons."""
    out = np.empty(words.size)
    _all(law.kind, law.q, law.sigma, law.table, law.functions, words, out)
    return out


@njit(cache=True, error_model="numpy", nogil=True)
def _all(kind, q, sigma, table, functions, words, out):  # type: ignore[no-untyped-def]
    for i in range(words.size):
        out[i] = draw(kind, q, sigma, table, functions, np.int64(words[i]))


def law_error(law: Law, words: npt.NDArray[np.uint32]) -> float:
    """Largest relative error of the thresholds of these words, plus one rounding.

    For the sum of both noises the distribution is inverted at these words. The relative error of a
    Gamma quantile is the next step of Newton's method, (F(x) - p) / (f(x) x), with F and p counted
    from the nearer end.
    """
    from scipy.special import gammainc, gammaincc, gammaln, ndtri

    rounding = float(np.finfo(np.float64).eps)
    if law.kind not in (_GAMMA, _TABLE):
        return rounding
    words = np.sort(words)
    x = draw_all(law, words)
    below = (words + 0.5) * 2.0**-32
    above = (0xFFFFFFFF - words.astype(np.int64) + 0.5) * 2.0**-32
    if law.sigma > 0:
        score = np.where(below < above, ndtri(below), -ndtri(above))
        unique, first = np.unique(score, return_index=True)
        off = x[first] / mixed_quantiles(law.q, law.sigma, unique) - 1
    else:
        density = np.exp((law.q - 1) * np.log(x) - x - gammaln(law.q))
        near = below < above
        missed = np.where(near, gammainc(law.q, x) - below, above - gammaincc(law.q, x))
        off = missed / (density * x)
    return float(np.abs(off).max()) + rounding


def reference_error(setting: CameraSetting, numbers: npt.NDArray[np.uint32]) -> float:
    """Relative error of the reference tier.

    It is the error of the first thresholds of these pixels against the inverse of their
    distribution. Instants are in closed form and exact up to rounding.

    Args:
        setting: setting of the camera.
        numbers: (n,) uint32, numbers of the pixels.
    """
    model = setting.model
    words = philox4x32((numbers, 0, 0, 0), (setting.seed, Stream.SHOT_NOISE))[0]
    return law_error(law_of(model.threshold, model.threshold_noise, model.shot), words)


def address(name: str) -> np.int64:
    """Address of a function of doubles in scipy.special.cython_special.

    The address changes from process to process, so compiled code takes it as an argument and never
    as a constant.
    """
    return np.int64(get_cython_function_address("scipy.special.cython_special", name))


def _call(builder: Any, args: list[Any]) -> Any:
    double, flag = ir.DoubleType(), ir.IntType(32)
    kind = ir.FunctionType(double, [double] * (len(args) - 1) + [flag])
    function = builder.inttoptr(args[0], kind.as_pointer())
    return builder.call(function, [*args[1:], ir.Constant(flag, 0)])


def _one(typing, where, x):  # type: ignore[no-untyped-def]
    def build(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return _call(builder, args)

    return types.float64(types.int64, types.float64), build


def _two(typing, where, a, x):  # type: ignore[no-untyped-def]
    def build(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return _call(builder, args)

    return types.float64(types.int64, types.float64, types.float64), build


call_one: Any = intrinsic(_one)
"""call_one(address, x): f(x) of the function at the address."""

call_two: Any = intrinsic(_two)
"""call_two(address, a, x): f(a, x) of the function at the address."""


def _tails(below: Values, above: Values, small: npt.NDArray[np.bool_]) -> tuple[Values, Values]:
    """Both tails, from the lower tail where it is the small one and the upper tail elsewhere."""
    lower, upper = np.empty(small.size), np.empty(small.size)
    lower[small], upper[~small] = below, above
    lower[~small], upper[small] = 1 - above, 1 - below
    return lower, upper


def mixed_law(q: float, sigma: float, x: Values) -> tuple[Values, Values, Values]:
    """(lower tail, upper tail, density) of Gamma(q, 1) + Normal(0, sigma) at x, (n,) each.

    With g = exp(t) the lower tail is the integral over t of exp(q t - g) / Gamma(q) times
    Phi((x - g) / sigma). The integrand is smooth and decays fast at both ends, so the trapezoid
    rule converges faster than any power of its step. If the gamma is the wider one and far from
    zero, the integral is taken over the normal variate. All terms are positive, so nothing cancels.
    """
    from scipy.special import gammainc, gammaincc, gammaln, ndtr

    lower, upper, density = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    narrow = (sigma * sigma < q) & (x - 12 * sigma > 0)
    if narrow.any():
        z = np.linspace(-10.5, 10.5, 106)
        weight = np.exp(-z * z / 2)
        weight /= weight.sum()
        g = x[narrow, None] - sigma * z
        # The smaller tail is computed, which keeps its digits; the other is 1 minus it.
        small = x[narrow] < q
        lower[narrow], upper[narrow] = _tails(
            gammainc(q, g[small]) @ weight, gammaincc(q, g[~small]) @ weight, small
        )
        density[narrow] = np.exp((q - 1) * np.log(g) - g - gammaln(q)) @ weight
    if not narrow.all():
        rest = x[~narrow]
        most = float(rest.max()) + 12 * sigma
        # If the gamma is the wider one, only lower tails remain, and g matters little beyond x.
        top = np.log(most if sigma * sigma < q else max(q + 12 * np.sqrt(q) + 80, most))
        bottom = min((np.log(1e-20) + gammaln(q + 1)) / q, np.log(q))
        if sigma * sigma >= q > 200:
            bottom = max(bottom, np.log(q) - 14 / np.sqrt(q))
        wide = min(1 / np.sqrt(q), sigma / most)
        t = np.linspace(bottom, top, int(np.clip(3 * (top - bottom) / wide, 400, 20_000)))
        g = np.exp(t)
        weight = np.exp(q * t - g - gammaln(q)) * (t[1] - t[0])
        # Below the first node the gamma counts as zero; above the last it has no mass.
        below = gammainc(q, g[0])
        score = (rest[:, None] - g) / sigma
        lower[~narrow] = ndtr(score) @ weight + below * ndtr(rest / sigma)
        upper[~narrow] = ndtr(-score) @ weight + below * ndtr(-rest / sigma)
        density[~narrow] = np.exp(-score * score / 2) @ weight / (sigma * np.sqrt(2 * np.pi))
        density[~narrow] += (
            below * np.exp(-((rest / sigma) ** 2) / 2) / (sigma * 2.5066282746310002)
        )
        if sigma * sigma < q:
            upper[~narrow] = 1 - lower[~narrow]
    return lower, upper, density


def mixed_quantiles(q: float, sigma: float, score: Values) -> Values:
    """Quantiles of Gamma(q) + Normal(0, sigma) at increasing normal scores, (n,) electrons.

    Newton's method on the score of the distribution, which is nearly linear in x, with bisection
    as the fallback.
    """
    from scipy.special import ndtri

    x = q + np.hypot(np.sqrt(q), sigma) * score + (score * score - 1) * q / (3 * (q + sigma**2))
    x = np.maximum(x, -sigma * 7)
    low, high = np.full(x.size, -sigma * 9), np.full(x.size, np.inf)
    best = np.inf
    for _ in range(60):
        lower, upper, density = mixed_law(q, sigma, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.where(lower < upper, ndtri(lower), -ndtri(upper))
            step = (score - z) * np.exp(-z * z / 2) / np.sqrt(2 * np.pi) / density
        low, high = (
            np.where(z < score, np.maximum(low, x), low),
            np.where(z > score, np.minimum(high, x), high),
        )
        after = x + step
        halved = np.where(
            np.isfinite(high), (low + np.where(np.isfinite(high), high, 0)) / 2, x * 2
        )
        # A step that rounds to nothing leaves x on its own bound: it stays there.
        after = np.where(np.isfinite(after) & (after >= low) & (after <= high), after, halved)
        moved = float(np.max(np.abs(after - x) / np.hypot(np.sqrt(q), sigma)))
        x = after
        # Newton doubles the digits in each step; a step that no longer shrinks is rounding.
        if moved < 1e-13 or (moved < 1e-11 and moved > best / 4):
            break
        best = moved
    if not np.abs(score - z).max() < _MISSED:
        raise ArithmeticError(f"thresholds of {q:g} e with noise of {sigma:g} e have no quantiles")
    return x


def _gamma_quantiles(q: float, score: Values) -> Values:
    """Quantiles of Gamma(q, 1) at normal scores, (n,) electrons, from the nearer tail."""
    from scipy.special import gammainccinv, gammaincinv, ndtr

    below = gammaincinv(q, ndtr(score))
    return np.asarray(np.where(score < 0, below, gammainccinv(q, ndtr(-score))))


def _edges(q: float, sigma: float) -> Values:
    """Quantiles of Gamma(q) + Normal(0, sigma) at the edges of the cells of `Law.table`, and their
    change in a unit of probability, (2 ends, 2, edges) electrons."""
    from scipy.interpolate import make_interp_spline
    from scipy.special import ndtri

    nodes = np.linspace(-_SCORE, _SCORE, _NODES if q > 10 else 3 * _NODES)
    values = mixed_quantiles(q, sigma, nodes) if sigma > 0 else _gamma_quantiles(q, nodes)
    spline = make_interp_spline(nodes, values, k=7)
    score = ndtri(np.cumsum(np.append(2.0**-33, _widths())))  # the sums are exact, up to 1 / 2
    steep = np.sqrt(2 * np.pi) * np.exp(score * score / 2)  # change of the score
    ends = [[spline(s * score), s * spline(s * score, 1) * steep] for s in (1, -1)]
    return np.array(ends)


def _widths() -> Values:
    """Probability of each cell of an end, from 2^-33 to the median."""
    return np.repeat(2.0 ** (np.arange(_OCTAVES) - 33 - _SHARED), 1 << _SHARED)


def _table(edges: Values) -> Values:
    """`Law.table` from `_edges`."""
    value, change, width = edges[:, 0], edges[:, 1], _widths()
    (a, b), (c, d) = (value[:, :-1], value[:, 1:]), (change[:, :-1] * width, change[:, 1:] * width)
    return np.stack([a, c, 3 * (b - a) - 2 * c - d, c + d - 2 * (b - a)], axis=2)
