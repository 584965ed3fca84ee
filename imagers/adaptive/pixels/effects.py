"""Effects of a three-transistor pixel: sources, costs, and the error if each is left out.

A cost is the difference of run time with and without the effect, measured once on one core at 2.5
GHz for a frame of 1024 x 1280 pixels at half scale and 10 ms. The planner uses this table on every
machine, so a plan does not depend on the machine.

A bound compares the distribution of the converted value with all effects and without the one
effect. The noise is taken as normal, then truncated and clipped as in the converter. The bound is
the larger of the change of the mean over max(mean, 1 DN) and the change of the noise over
max(noise, 1/sqrt(12) DN): RMS over the position of the mean between two steps of the converter (and
over the pattern), maximum over light and exposure. Bounds are estimates: the distributions are not
exactly normal, and several noises left out together add up to slightly more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from imagers.adaptive.pixels.setting import BITS, CmosSetting
from imagers.common.frame_pixel import steady_effects
from sensor.frame_pixels import ImagerSummary

COSTS: Final[dict[str, float]] = {
    "shot noise": 145.0,
    "dark current": 7.0,
    "dark shot noise": 100.0,
    "reset noise": 95.0,
    "read noise": 95.0,
    "DSNU": 11.0,
    "PRNU": 7.0,
    "column pattern": 11.0,
}


Values = npt.NDArray[np.float64]
_FLOOR: Final = 1 / np.sqrt(12)
_LEVELS: Final = 5
_PLACES: Final = (np.arange(8) + 0.5) / 8
_NODES: Final = ((-np.sqrt(3.0), 1 / 6), (0.0, 2 / 3), (np.sqrt(3.0), 1 / 6))
"""Gauss-Hermite: a standard normal number by three."""


def truncated(mean: Values, variance: Values) -> tuple[Values, Values]:
    """Mean and standard deviation of a normal number once truncated and clipped to 0..255, DN."""
    from scipy.special import ndtr

    steps = np.arange(1, 1 << BITS, dtype=np.float64)
    sigma = np.sqrt(np.maximum(variance, 1e-12))[..., None]
    above = ndtr((mean[..., None] - steps) / sigma)
    first, second = above.sum(-1), (above * (2 * steps - 1)).sum(-1)
    return first, np.sqrt(np.maximum(second - first**2, 0.0))


@dataclass(frozen=True, eq=False)
class _State:
    """Photoelectrons and exposure times (s) of pixels, two arrays of one shape."""

    light: Values
    seconds: Values


Parts = Callable[[CmosSetting, _State], tuple[Values, Values, Values]]
"""What an effect adds, in electrons: mean, variance, standard deviation over pixels."""


def _parts(s: CmosSetting) -> dict[str, Parts]:
    def zeros(state: _State) -> Values:
        return np.zeros_like(state.light)

    def steady(variance: float) -> Parts:
        return lambda s, x: (zeros(x), zeros(x) + variance, zeros(x))

    return {
        "shot noise": lambda s, x: (zeros(x), x.light, zeros(x)),
        "dark current": lambda s, x: (
            s.dark_now * x.seconds, s.dark_now * x.seconds, s.dsnu * s.dark_now * x.seconds,
        ),
        "dark shot noise": lambda s, x: (zeros(x), s.dark_now * x.seconds, zeros(x)),
        "reset noise": steady(s.reset_noise**2),
        "read noise": steady(s.read_noise**2),
        "DSNU": lambda s, x: (zeros(x), zeros(x), s.dsnu * s.dark_now * x.seconds),
        "PRNU": lambda s, x: (zeros(x), zeros(x), s.prnu * x.light),
        "column pattern": lambda s, x: (
            zeros(x), zeros(x), zeros(x) + s.column * (1 << BITS) * s.step,
        ),
    }  # fmt: skip


def _states(scene: Summary, s: CmosSetting) -> _State:
    """(tiles, levels x exposures): light from the least to the largest that does not clip."""
    assert isinstance(scene, ImagerSummary)
    most = (1 << BITS) * s.step
    low = np.minimum(np.atleast_1d(np.asarray(scene.darkest, np.float64)), most)
    high = np.minimum(np.atleast_1d(np.asarray(scene.brightest, np.float64)), most)
    low, high = np.broadcast_arrays(low, high)
    start = np.maximum(low, np.minimum(0.5 * s.step, np.maximum(high, 1e-9)))
    levels = np.geomspace(start, np.maximum(high, start), _LEVELS, axis=-1)
    levels = np.concatenate([low[:, None], levels], axis=-1)
    light = np.concatenate([levels, levels], axis=-1)
    seconds = np.repeat(np.asarray(scene.exposure, np.float64), _LEVELS + 1)
    return _State(light, np.broadcast_to(seconds, light.shape))


def _bound(name: str, s: CmosSetting) -> Callable[[Summary], Bound]:
    def bound(scene: Summary) -> Bound:
        state = _states(scene, s)
        parts = _parts(s)
        mean = state.light + parts["dark current"](s, state)[0]
        variance = sum(
            (parts[k](s, state)[1] for k in ("shot noise", "dark shot noise", "reset noise",
                                             "read noise")),
            np.zeros_like(mean),
        )  # fmt: skip
        less, quiet, spread = parts[name](s, state)
        squares = np.zeros((2, *mean.shape))
        for node, weight in _NODES:
            for place in _PLACES:
                at = mean / s.step + place + node * spread / s.step
                m1, d1 = truncated(at, variance / s.step**2)
                without = at - (less + node * spread) / s.step
                m0, d0 = truncated(without, np.maximum(variance - quiet, 0.0) / s.step**2)
                share = weight / len(_PLACES)
                squares[0] += share * ((m1 - m0) / np.maximum(m1, 1.0)) ** 2
                squares[1] += share * ((d1 - d0) / np.maximum(d1, _FLOOR)) ** 2
        worst = np.sqrt(squares).max(axis=(0, 2))
        return Bound(float(worst[0]) if np.ndim(scene.darkest) == 0 else worst, "estimate")

    return bound


def make_effects(s: CmosSetting) -> dict[str, Effect]:
    """All effects of a pixel of this setting, by name."""
    sources = {
        "shot noise": (Stream.IMAGER_SHOT, "Poisson law of photoelectrons"),
        "dark current": (Stream.NONE, "I0 2^((T - T0)/Td), Td 6 to 7 K; assumed rate"),
        "dark shot noise": (Stream.IMAGER_DARK, "Poisson law of dark electrons"),
        "reset noise": (Stream.IMAGER_RESET, "sqrt(2 k T C)/q: reset after read"),
        "read noise": (Stream.IMAGER_READ, "source follower and converter; assumed"),
        "DSNU": (Stream.IMAGER_PATTERN, "dark current from pixel to pixel; assumed"),
        "PRNU": (Stream.IMAGER_PATTERN, "response from pixel to pixel; assumed"),
        "column pattern": (Stream.IMAGER_PATTERN, "offset of column amplifiers; assumed"),
    }
    return steady_effects(sources, COSTS, lambda name: _bound(name, s))
