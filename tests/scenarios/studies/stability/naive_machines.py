"""Displays, methods of a link and control loops as one would first write them: what cases 22 to 38
of the stability suite are there to catch.

Each display is the golden model with one line as one would write it first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.special import erfc, gamma, kv
from scipy.stats import binom

from display.render import golden
from display.render.golden import GoldenRenderer
from imagers.adaptive.device.decision import Search
from imagers.emccd.device.cooling import Cooler
from link.line_codes import CATALOGUE, encode_line
from tests.imagers.adaptive.naive_rules import from_register, unlimited


class Float32Sums(GoldenRenderer):
    """Case 22: light is added up in float32."""

    def _integrate(self, image, views):  # type: ignore[no-untyped-def]
        total = self._images[image].astype(np.float32)
        for span, light in enumerate(self.light):
            total += (views.weight[image, span] * light).astype(np.float32)
        self._images[image] = total


class WrappingAge(GoldenRenderer):
    """Case 23: an age of 32 bits goes on from 2^32 - 1 to 0."""

    def _plane(self, spike):  # type: ignore[no-untyped-def]
        again = self.age == golden.FOREVER
        self.age = np.where(again, np.uint32(0), self.age)
        light = super()._plane(spike)
        self.age = np.where(again & ~spike, np.uint32(0), self.age)
        return np.where(again & ~spike, 1.0 / np.maximum(self.tau, 1), light)


class NoInterval(GoldenRenderer):
    """Case 23: 1 / tau before there is a tau."""

    def _plane(self, spike):  # type: ignore[no-untyped-def]
        light = super()._plane(spike)
        with np.errstate(divide="ignore", invalid="ignore"):
            return light if self.panel.drive == "impulse" else light + (1.0 / self.tau) * 0.0


class SpikeAtTheStart(GoldenRenderer):
    """Case 24: the first interval begins with the run."""

    def __init__(self, *given) -> None:  # type: ignore[no-untyped-def]
        super().__init__(*given)
        self.started[:] = True


class DarkPlanes(GoldenRenderer):
    """Case 25: an interval is the dark planes between two spikes."""

    def _plane(self, spike):  # type: ignore[no-untyped-def]
        light = super()._plane(spike)
        self.tau = np.where(spike & (self.tau > 0), self.tau - 1, self.tau).astype(np.uint32)
        return np.where(self.tau > 0, light, 0.0) if self.panel.drive != "impulse" else light


class ExplicitEuler(GoldenRenderer):
    """Case 26: one step of y' = (x - y) / c."""

    def _relax(self, drive, share):  # type: ignore[no-untyped-def]
        up = drive > self.level
        constant = np.where(up, self.panel.rise, self.panel.decay) * self.panel.clock.hz
        with np.errstate(over="ignore", invalid="ignore"):
            light = self.level * share
            self.level = self.level + (drive - self.level) * share / constant
        return light


class AtTheEdge(GoldenRenderer):
    """Case 27: a position beside the panel sees the panel's edge, or comes in at the other side."""

    around = False

    def _integrate(self, image, views):  # type: ignore[no-untyped-def]
        width = self.panel.shape[1]
        for span, light in enumerate(self.light):
            x = np.floor(np.arange(width) + views.dx[image, span])
            x = (x % width if self.around else np.clip(x, 0, width - 1)).astype(int)
            self._images[image] += views.weight[image, span] * light[:, x]


class AroundTheEdge(AtTheEdge):
    """Case 27."""

    around = True


def printed_capacity(dark: float) -> float:
    """Case 28: the formula as it is printed."""
    s = np.float64(dark)
    with np.errstate(all="ignore"):
        q = (1 + s) ** (1 + s) / (s**s * np.e) - s
        nats = q * (1 + s) * np.log(1 + s) + (1 - q) * s * np.log(s) - (q + s) * np.log(q + s)
    return float(nats / np.log(2))


def density_quadrature(amplitude: float, alpha: float, beta: float) -> float:
    """Case 29: the density of the intensity by gamma functions and a Bessel function, summed over
    intensities to 20."""
    i = np.linspace(1e-6, 20, 200_001)
    with np.errstate(all="ignore"):
        density = 2 * np.float64(alpha * beta) ** ((alpha + beta) / 2)
        density /= gamma(alpha) * gamma(beta)
        density = density * i ** ((alpha + beta) / 2 - 1)
        density = density * kv(alpha - beta, 2 * np.sqrt(alpha * beta * i))
        values = density * erfc(amplitude * i / 2 / np.sqrt(2)) / 2
    return float(values.sum() * (i[1] - i[0]))


def one_less_cdf(n: int, t: int, p: float) -> float:
    """Case 30: what is not mended is all but what is."""
    return float(1 - binom.cdf(t, n, p))


def products(line, soft):  # type: ignore[no-untyped-def]
    """Case 31: the word of the largest product of its symbols' probabilities."""
    count = {"manchester": 2, "4b6b": 16, "8b10b": 256}[line]
    every = np.arange(count, dtype=np.uint8)[None]
    with np.errstate(all="ignore"):
        on = 1 / (1 + np.exp(-soft.astype(np.float64)))
    off = 1 - on
    symbols = CATALOGUE[line].symbols
    best = np.zeros((count, soft.shape[1]))
    for start in (False, True) if line == "8b10b" else (False,):
        word = encode_line(line, every, disparity=np.full(count, start))
        chance = np.ones_like(best)
        for k in range(symbols):
            chance = chance * np.where(word[k][:, None], on[k], off[k])
        best = np.maximum(best, chance)
    return best.argmax(0)[None].astype(np.uint8)


def bytes_as_they_are(line, values):  # type: ignore[no-untyped-def]
    """Case 32: no line code: as many of a value's bits as the code has symbols."""
    symbols = CATALOGUE[line].symbols
    bits = [(values.astype(np.uint16) >> k) & 1 for k in range(symbols)]
    return np.stack(bits, axis=1).reshape(-1, values.shape[1]).astype(bool)


def one_disparity(line, values):  # type: ignore[no-untyped-def]
    """Case 32: every group of 8B10B begins as if the disparity were negative."""
    return np.concatenate([encode_line(line, group[None]) for group in values])


def no_end(search: int) -> Any:
    """Shortens below the shortest exposure, to none."""
    return unlimited(Search(search))


def twice_followed(search: int) -> Any:
    """Reckons from a decision that no frame has shown yet."""
    return from_register(Search(search))


def wound_up(air: Callable[[float], float]) -> Cooler:
    """Integrates while the drive stands at its end."""
    return Cooler(air, 263.15, anti_windup=False)
