"""Naive displays, one at least for each of cases 22 to 27 of the stability suite.

Each is the golden model with one line as one would write it first.
"""

from __future__ import annotations

import numpy as np

from display.render import golden
from display.render.golden import GoldenRenderer


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
