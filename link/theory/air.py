"""Light through air: attenuation by visibility, turbulence, and on-off keying under fading.

Units: cn2, the refractive-index structure constant, m^(-2/3); wavelength, length, diameter, m.

The signal is `amplitude` times the intensity I (mean 1) if ON, and 0 if OFF. The noise is Gaussian
of standard deviation 1, ON and OFF are equally likely, and the receiver knows I: error rate
Q(amplitude I / 2). Two conventions of the electrical signal-to-noise ratio are in use, 3 dB apart;
`amplitude_of` accepts either:

    peak     snr = amplitude^2        error Q(sqrt(snr) I / 2)
    average  snr = amplitude^2 / 2    error Q(sqrt(snr / 2) I): power averaged over ON and OFF

(written for E[Q(g I / 2)] and E[Q(g I / sqrt 2)] with g^2 = snr.)

The averages use the trapezoidal rule in ln I, whose error falls exponentially for such integrands
(Trefethen, Weideman, SIAM Review 56:385, 2014). The closed form of the gamma-gamma law is a Meijer
G function, whose terms overflow from alpha near 170 and cancel at high signal-to-noise ratios; its
density has the same problem through the Bessel function. Here a gamma-gamma intensity is computed
as a product of two gamma variates, with all weights in logarithms, so any alpha, beta and amplitude
is possible.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Particles = Literal["kim", "kruse"]
PRINTED: Final = 3.91
"""-ln 0.02, Koschmieder at a contrast of 2 %, as printed by Kim (exact: 3.912)."""
DB_PER_NEPER: Final = 10 / np.log(10)
REFERENCE_NM: Final = 550.0
"""Wavelength that visibility refers to, nm."""
RYTOV: Final = {"plane": 1.23, "spherical": 0.4 * 1.23}
"""Andrews and Phillips, Laser Beam Propagation through Random Media, 2nd ed., section 8.2."""
LARGE: Final = (0.49, 1.11, 7 / 6)
SMALL: Final = (0.51, 0.69, 5 / 6)
"""(strength, saturation, power) of large and small eddies for a plane wave without inner scale:
Al-Habash, Andrews, Phillips, Opt. Eng. 40:1554 (2001)."""
Convention = Literal["peak", "average"]
_FINE, _COARSE = 0.4, 0.125
"""Steps of the rule: _FINE in standard deviations of the law, _COARSE as the upper limit. The error
is about exp(-2 pi d / step) if the integrand has no singularity or growth within d of the axis:
exp(-79) for a Gaussian of deviation 1, exp(-39) for Q(e^u), whose d is pi / 4."""
_AT_ONCE: Final = 1 << 18
"""Number of integrand values computed at once."""


def size_exponent(visibility_km: npt.ArrayLike, particles: Particles = "kim") -> Array:
    """q of extinction ~ wavelength^-q.

    Kim, McArthur, Korevaar, SPIE 4214:26 (2001): 1.6 above 50 km, 1.3 from 6, 0.16 V + 0.34 from 1,
    V - 0.5 from 0.5, 0 below, where fog is grey. Kruse, McGlauchlin, McQuistan, Elements of
    Infrared Technology (1962): 0.585 V^(1/3) below 6 km.
    """
    v = np.asarray(visibility_km, np.float64)
    if not (v > 0).all():
        raise ValueError("visibility must be above 0")
    if particles == "kruse":
        return np.select([v > 50, v > 6], [1.6, 1.3], 0.585 * np.cbrt(v))
    return np.select([v > 50, v > 6, v > 1, v > 0.5], [1.6, 1.3, 0.16 * v + 0.34, v - 0.5], 0.0)


def extinction_db_per_km(
    visibility_km: npt.ArrayLike, wavelength_nm: npt.ArrayLike, particles: Particles = "kim"
) -> Array:
    """Attenuation, dB/km: 4.343 (3.91 / V) (wavelength / 550 nm)^-q.

    ITU-R P.1814 equation 4 omits the factor 4.343 and calls the result dB; it is in nepers.
    """
    v, nm = np.asarray(visibility_km, np.float64), np.asarray(wavelength_nm, np.float64)
    q = size_exponent(v, particles)
    return np.asarray(DB_PER_NEPER * PRINTED / v * (nm / REFERENCE_NM) ** -q)


def rytov(
    cn2: npt.ArrayLike,
    wavelength: npt.ArrayLike,
    length: npt.ArrayLike,
    wave: Literal["plane", "spherical"] = "plane",
) -> Array:
    """Rytov variance, 1.23 Cn2 k^(7/6) L^(11/6); 0.4 of it for a spherical wave."""
    k = 2 * np.pi / np.asarray(wavelength, np.float64)
    return np.asarray(RYTOV[wave] * np.asarray(cn2) * k ** (7 / 6) * np.power(length, 11 / 6))


def gamma_gamma(sigma2: npt.ArrayLike) -> tuple[Array, Array]:
    """(alpha, beta), the effective numbers of large and small eddies for a Rytov variance.

    The variance must be above 0. Both tend to 1 / (0.49 sigma2) as it tends to 0; expm1 preserves
    this, while exp(x) - 1 is 0 below 1e-16.
    """
    s = np.asarray(sigma2, np.float64)
    if not (s > 0).all():
        raise ValueError("sigma2 must be above 0: without turbulence nothing fades")
    numbers = (
        1 / np.expm1(a * s / (1 + b * s ** (6 / 5)) ** power) for a, b, power in (LARGE, SMALL)
    )
    alpha, beta = numbers
    return np.asarray(alpha), np.asarray(beta)


def scintillation_index(alpha: npt.ArrayLike, beta: npt.ArrayLike) -> Array:
    """Variance of the intensity over its squared mean, 1/alpha + 1/beta + 1/(alpha beta)."""
    a, b = np.asarray(alpha, np.float64), np.asarray(beta, np.float64)
    return np.asarray(1 / a + 1 / b + 1 / (a * b))


def correlation_time(
    wavelength: npt.ArrayLike, length: npt.ArrayLike, wind: npt.ArrayLike
) -> Array:
    """Correlation time of the intensity, s: sqrt(lambda L) / V.

    A Fresnel zone is carried past a point by the wind (Taylor's frozen flow).
    """
    zone = np.sqrt(np.asarray(wavelength, np.float64) * np.asarray(length, np.float64))
    return np.asarray(zone / np.asarray(wind, np.float64))


def amplitude_of(snr_db: npt.ArrayLike, convention: Convention) -> Array:
    """ON signal over the standard deviation of the noise."""
    snr = 10 ** (np.asarray(snr_db, np.float64) / 10)
    return np.asarray(np.sqrt(snr if convention == "peak" else 2 * snr))


def awgn_ook(amplitude: npt.ArrayLike) -> Array:
    """Q(amplitude / 2), accurate in the far tail."""
    from scipy.special import ndtr

    return np.asarray(ndtr(-np.asarray(amplitude, np.float64) / 2))


def log_normal_sigma(index: npt.ArrayLike) -> Array:
    """Standard deviation of ln I for a log-normal scintillation index: sqrt(ln(1 + SI))."""
    return np.asarray(np.sqrt(np.log1p(np.asarray(index, np.float64))))


def log_normal_ook(amplitude: npt.ArrayLike, sigma: float) -> Array:
    """E[Q(amplitude I / 2)], ln I normal of deviation sigma and mean -sigma^2 / 2."""
    if sigma < 0:
        raise ValueError(f"sigma must be at least 0, not {sigma}")
    if sigma == 0:
        return awgn_ook(amplitude)
    # The whole range of the normal law in float64: a strong signal moves the peak far into a tail.
    a = np.atleast_1d(np.asarray(amplitude, np.float64))
    z = np.linspace(-38.5, 38.5, 2569)
    intensity = np.exp(np.minimum(sigma * z - sigma**2 / 2, 700.0))
    logs = -z * z / 2 - np.log(2 * np.pi) / 2 + _log_q(a[:, None] * intensity / 2)
    out = np.exp(logs).sum(1) * (z[1] - z[0])
    return np.asarray(out.reshape(np.shape(amplitude)))


def _log_q(x: Array) -> Array:
    from scipy.special import log_ndtr

    return np.asarray(log_ndtr(-x))


def _log_gamma_nodes(shape: float, deepest: float) -> tuple[Array, Array]:
    """(ln x, ln weight) of a gamma variate of mean 1 on evenly spaced nodes of ln x.

    The density of u = ln x is exp(shape (u - e^u) + shape ln shape - ln Gamma(shape)). Its peak has
    width 1 / sqrt(shape); to the left it is an exponential of slope shape, to the right double
    exponential. The constant is Stirling's where its terms are large and cancel.

    Args:
        shape: shape of the gamma law.
        deepest: ln x below which the averaged function is constant.
    """
    from scipy.special import gammaln

    deviation = 1 / np.sqrt(shape)
    # A narrow law vanishes beyond 12 deviations; a wide one extends to the deepest value.
    left = -12 * deviation if shape > 1e3 else -60 / shape - 12 * deviation + min(deepest, 0.0)
    right = min(12 * deviation, np.log1p(60 / shape) + 1)
    step = min(_FINE * deviation, _COARSE)
    u = np.linspace(left, right, int(np.ceil((right - left) / step)) + 1)
    bend = np.where(np.abs(u) < 1e-3, -(u**2) / 2 - u**3 / 6 - u**4 / 24, u - np.expm1(u))
    if shape > 1e3:
        constant = np.log(shape / (2 * np.pi)) / 2 - 1 / (12 * shape)
    else:
        constant = shape * np.log(shape) - float(gammaln(shape)) - shape
    return u, shape * bend + constant + np.log(u[1] - u[0])


def gamma_gamma_ook(amplitude: npt.ArrayLike, alpha: float, beta: float) -> Array:
    """E[Q(amplitude I / 2)], I the product of gamma variates of shapes alpha and beta, mean 1.

    Args:
        amplitude: amplitude of the ON signal over noise; 0 or less gives 1/2.
        alpha, beta: shape from 0.2 up (a saturated plane wave has beta = 1).
    """
    if not (alpha >= 0.2 and beta >= 0.2):
        raise ValueError(f"alpha and beta must be at least 0.2, not {alpha}, {beta}")
    return np.asarray(np.vectorize(_gamma_gamma_ook, [float])(amplitude, alpha, beta))


def _gamma_gamma_ook(amplitude: float, alpha: float, beta: float) -> float:
    from scipy.special import logsumexp

    if amplitude <= 0:
        return 0.5
    deepest = -np.log(amplitude)  # below it, noise dominates even ON
    u, wu = _log_gamma_nodes(alpha, deepest)
    v, wv = _log_gamma_nodes(beta, deepest)
    rows = max(1, _AT_ONCE // v.size)
    parts = []
    for i in range(0, u.size, rows):
        intensity = np.exp(np.minimum(u[i : i + rows, None] + v, 700.0))
        logs = wu[i : i + rows, None] + wv + _log_q(amplitude * intensity / 2)
        parts.append(float(logsumexp(logs)))
    return float(np.exp(logsumexp(parts)))
