"""Metastability: a latch whose input changes as it is asked, and that has not decided when read.

A latch whose input changes within its window T_w hangs between its two states and leaves them at a
rate 1 / tau: after the time t that it is given, exp(-t / tau) of them are still undecided. Spikes
at f_d on a clock at f_c fall into windows T_w f_c f_d times a second, so T_w f_c f_d exp(-t / tau)
of them a second are read undecided (Veendrick, IEEE J. Solid-State Circuits 15:169, 1980; Ginosar,
IEEE Design & Test of Computers 28(5):23, 2011).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary

__all__ = ["Metastability", "metastability_effect"]


@dataclass(frozen=True)
class Metastability:
    """window: T_w in seconds, centred on each edge. given: seconds that a latch has to decide. tau:
    its time constant in seconds."""

    window: float
    given: float
    tau: float

    def __post_init__(self) -> None:
        if not (self.window >= 0 and self.given >= 0 and 0 < self.tau < math.inf):
            raise ValueError(
                f"window and given must be 0 s or more and tau above 0 s, not {self.window:g}, "
                f"{self.given:g} and {self.tau:g} s"
            )

    def share(self, clock: Clock) -> float:
        """Of the spikes that come at any phase, those that are read undecided."""
        return min(self.window * clock.hz, 1.0) * math.exp(-self.given / self.tau)

    def undecided(
        self,
        instants: npt.NDArray[np.int64],
        clock: Clock,
        pixels: npt.NDArray[np.uint32],
        spikes: npt.NDArray[np.uint64],
        seed: int,
    ) -> npt.NDArray[np.bool_]:
        """Which of these spikes are read undecided, (n,).

        instants: (n,) ps. pixels, spikes: number of each one's pixel and its index there. The time
        that spike k takes to decide is -tau log u, u being 64 bits at counter (pixel, k high, k
        low, 0), key (seed, METASTABILITY); so it depends on nothing but these. Raises ValueError
        where an instant is too late for 64 bits on this clock.
        """
        # Position in cycles is instant times a / b in lowest terms.
        step = clock.position(1)
        a, b = step.numerator, step.denominator
        if instants.size and int(np.abs(instants).max()) > (2**63 - 1) // a:
            raise ValueError(f"instants must stay below {(2**63 - 1) // a} ps on {clock}")
        phase = (instants * a) % b / b
        near = np.minimum(phase, 1 - phase) < self.window * clock.hz / 2
        found = np.flatnonzero(near)
        k = spikes[found]
        counter = (pixels[found], k >> np.uint64(32), k & np.uint64(0xFFFFFFFF), 0)
        high, low, _, _ = philox4x32(counter, (seed, Stream.METASTABILITY))
        u = (high + (low + 0.5) * 2.0**-32) * 2.0**-32
        near[found] = -self.tau * np.log(u) > self.given
        return np.asarray(near)


def metastability_effect(setting: Metastability, clock: Clock) -> Effect:
    """An undecided latch puts a spike into one of two neighbouring cycles, so at most this share of
    the spikes moves by a cycle."""

    def bound(scene: Summary) -> Bound:
        return Bound(setting.share(clock), "estimate")

    source = "T_w f_c f_d exp(-t/tau): Veendrick 1980; Ginosar 2011"
    return Effect("metastability", source, Stream.METASTABILITY, bound)
