"""Cases 10, 12 and 16: instants of firing against clocks: light at half the latch clock, latches
that have not decided, and delays longer than a cycle."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock, Light, Piece
from cosim.compute.opencl import Device
from cosim.run.case import Case
from cosim.spikes.viform import unpack_planes
from sensor import make_pixels
from sensor.asynchronous import AsynchronousPixels, EventModel
from sensor.latched.effects import RESIDUAL, Metastability
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.model import ExactModel
from sensor.stability.chance import Z
from sensor.stability.gathering import CLOCK, constant

Instants = npt.NDArray[np.int64]
_FINE: Final = Clock(10**9)
"""Clock of asynchronous pixels where it must bind nobody."""

# 10 ------------------------------------------------------------------------------------------

KNOTS: Final = 100
"""Straight pieces of light in a period of the sine, of 500 ns each."""
PERIOD: Final = 2 * CLOCK.edge(1)
BEFORE: Final = PERIOD * 3 // 10
"""Steady light before the sine, so that no spike falls on an edge."""
MEAN: Final = 2.0e7
"""Electrons a second; the threshold is what a period of the sine brings."""
THRESHOLD: Final = 1000


class Sine(NamedTuple):
    """Two ways through the same light (gain 1): fire: (light, threshold, stop in ps) -> instants of
    firing.

    Attributes:
        latch: (light, threshold, cycles) -> bits of each cycle at 40 kHz.
    """

    fire: Callable[[Light, int, int], Instants]
    latch: Callable[[Light, int, int], npt.NDArray[np.uint8]]


def _sine(device: Device | None) -> Sine:
    def fire(light: Light, threshold: int, stop: int) -> Instants:
        model = EventModel(threshold, 1, _FINE, 1000, shot=False)
        return AsynchronousPixels(model, (1, 1), 1.0).step(light, 0, stop).instant

    def latch(light: Light, threshold: int, cycles: int) -> npt.NDArray[np.uint8]:
        pixels = make_pixels(
            ExactModel(float(threshold), 1, (RESIDUAL,)), np.zeros(1, np.uint32), device
        )
        words = pixels.expose(Exposure(CLOCK, 1.0).spans(light, 0, cycles), cycles)
        return unpack_planes(words[:, None, :], 0, cycles)[:, 0, 0]

    return Sine(fire, latch)


def sine_light(phase: float, periods: int) -> Light:
    """Steady light, then MEAN (1 + sin(2 pi 20 kHz (t - BEFORE) + phase)) in straight pieces, whose
    integral at every knot is the sine's own: the trapezoid rule takes h/2 cot(h/2) of it."""
    half = math.pi / KNOTS
    swing = MEAN / (half / math.tan(half)) * 0.999
    base = np.full((1, 1), MEAN, np.float32)
    angles = phase + 2 * half * np.arange(KNOTS)
    levels = [np.full((1, 1), MEAN + swing * math.sin(a), np.float32) for a in angles]
    step, pieces = PERIOD // KNOTS, [Piece(0, BEFORE, base, base)]
    for n in range(periods * KNOTS):
        at = BEFORE + n * step
        first, last = levels[n % KNOTS], levels[(n + 1) % KNOTS]
        pieces.append(Piece(at, at + step, first, last))
    return Light(tuple(pieces))


def sine_charge(ps: float, phase: float) -> float:
    """Electrons up to an instant: the closed form."""
    if ps <= BEFORE:
        return MEAN * ps / PS
    w = 2 * math.pi / PERIOD
    turned = math.cos(phase) - math.cos(phase + w * (ps - BEFORE))
    return MEAN * (ps + 0.999 * turned / w) / PS


def half_clock(method: Sine, periods: int = 12) -> float:
    """Largest error of a firing instant against the inverse of the integral, in periods of the
    sine, at four phases; infinite where a latch bit is wrong or the bits are not of period 2."""
    from scipy.optimize import brentq

    worst = 0.0
    for phase in (0.0, math.pi / 2, math.pi, 3 * math.pi / 2):
        light, stop = sine_light(phase, periods), PERIOD * periods
        exact = np.array(
            [
                brentq(
                    lambda t, k=k, phase=phase: sine_charge(t, phase) - k * THRESHOLD,
                    (k - 1) * PERIOD, (k + 1) * PERIOD, xtol=1e-3, rtol=1e-15,
                )
                for k in range(1, periods + 1)
            ]
        )  # fmt: skip
        exact = exact[exact <= stop]
        instants = method.fire(light, THRESHOLD, stop)
        if instants.size != exact.size:
            return math.inf
        worst = max(worst, float(np.abs(instants - exact).max()) / PERIOD)
        bits = method.latch(light, THRESHOLD, 2 * periods)
        due = np.bincount((exact // CLOCK.edge(1)).astype(int), minlength=2 * periods)
        if not np.array_equal(bits, due) or not np.array_equal(bits[4:], bits[2:-2]):
            return math.inf
    return worst


# 12 ------------------------------------------------------------------------------------------

Undecided = Callable[
    [Metastability, Instants, Clock, npt.NDArray[np.uint32], npt.NDArray[np.uint64]],
    npt.NDArray[np.bool_],
]
"""(setting, instants in ps, clock, pixels, spike indices) -> which are read undecided."""


def _undecided(device: Device | None) -> Undecided:
    def look(
        setting: Metastability,
        instants: Instants,
        clock: Clock,
        pixels: npt.NDArray[np.uint32],
        spikes: npt.NDArray[np.uint64],
    ) -> npt.NDArray[np.bool_]:
        return setting.undecided(instants, clock, pixels, spikes, 9)

    return look


def undecided(look: Undecided, n: int = 4_000_000) -> float:
    """Largest |z| of the number of undecided reads against T_w f_c f_d exp(-t / tau) times the
    time, for spikes of asynchronous pixels under shot noise."""
    clock, side = Clock(10_000_000), 64
    model = EventModel(10, 4, _FINE, 1000)
    rate = 4e6 * 10  # electrons a second: spikes come at 0.4 of the latch clock
    stop = round(n / (side * 4e6) * PS)
    fired = AsynchronousPixels(model, (1, side), rate).step(constant([1.0] * side, stop), 0, stop)
    order = np.argsort(fired.pixel, kind="stable")
    pixels, instants = fired.pixel[order], fired.instant[order]
    spikes = np.arange(pixels.size) - np.searchsorted(pixels, pixels)
    worst, tau = 0.0, 25e-12
    for given in (0.0, tau, 5 * tau):
        setting = Metastability(4e-9, given, tau)
        found = look(setting, instants, clock, pixels, spikes.astype(np.uint64))
        p = 4e-9 * clock.hz * math.exp(-given / tau)
        due = pixels.size * p  # T_w f_c exp(-t / tau) of f_d times the time
        worst = max(worst, abs(int(found.sum()) - due) / math.sqrt(due * (1 - p)))
    return worst


# 16 ------------------------------------------------------------------------------------------

Late = Callable[[float, int, int, int, int], Instants]
"""(electrons a second, threshold, delay and reset in ps, stop in ps) -> instants of firing."""


def _late(device: Device | None) -> Late:
    def fire(light: float, threshold: int, delay: int, reset: int, stop: int) -> Instants:
        model = EventModel(threshold, 1, _FINE, 1000, delay=delay, reset=reset, shot=False)
        return AsynchronousPixels(model, (1, 1), light).step(constant([1.0], stop), 0, stop).instant

    return fire


def delays(fire: Late) -> float:
    """Largest distance of an instant from k (Q/light + delay) + (k - 1) reset, in ps; infinite
    where instants do not rise. Delays of 1, 1.5 and 4 latch cycles, resets of 0 and 1 ps."""
    worst, stop = Fraction(0), PS // 100
    for light in (1e3, 7e6, 1e9):
        for cycles in (Fraction(1), Fraction(3, 2), Fraction(4)):
            for reset in (0, 1):
                delay = int(cycles * CLOCK.edge(1))
                instants = fire(light, 100, delay, reset, stop).tolist()
                own = Fraction(100 * PS) / Fraction(light) + delay
                due = int((stop + reset) // (own + reset))
                if len(instants) != due or any(b <= a for a, b in pairwise(instants)):
                    return math.inf
                for k, instant in enumerate(instants, 1):
                    worst = max(worst, abs(instant - k * own - (k - 1) * reset))
    return float(worst)


FIRING: Final = (
    Case(
        10,
        "light at half the latch clock",
        "a 20 kHz sine at four phases fires at the inverse of its integral, with bits of period 2",
        "closed integral, inverted by Brent's method",
        "light of a cycle taken as at its edge",
        "periods",
        1e-6,
        half_clock,
        _sine,
        {"periods": 4},
    ),
    Case(
        12,
        "metastability",
        "undecided reads come at T_w f_c f_d exp(-t/tau)",
        "the closed form, binomial",
        "no time to decide",
        "|z|",
        Z,
        undecided,
        _undecided,
        {"n": 1_000_000},
    ),
    Case(
        16,
        "delay of cycles, reset in no time",
        "no negative interval; spike k at k (Q/light + delay) + (k - 1) reset, rounded up to 1 ps",
        "fractions",
        "delay taken off at the latch",
        "ps",
        1.0,
        delays,
        _late,
    ),
)
