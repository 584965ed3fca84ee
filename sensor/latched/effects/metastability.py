"""Metastability: a latch that is sampled while its input changes, and is read before it settles.

A latch whose input changes within a window T_w around the clock edge becomes metastable. It settles
at a rate of 1 / tau, so that after a resolution time t the share exp(-t / tau) of such latches is
still undecided. Spikes at a rate f_d on a clock of f_c are therefore read undecided at a rate of
T_w f_c f_d exp(-t / tau) (Veendrick, IEEE J. Solid-State Circuits 15:169, 1980; Ginosar, IEEE
Design & Test of Computers 28(5):23, 2011).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream


@dataclass(frozen=True)
class Metastability:
    """Constants of a latch.

    Attributes:
        window: T_w in seconds, centred on each clock edge.
        resolution_time: seconds from the clock edge to the read.
        tau: time constant of the latch in seconds.
    """

    window: float
    resolution_time: float
    tau: float

    def __post_init__(self) -> None:
        if not (self.window >= 0 and self.resolution_time >= 0 and 0 < self.tau < math.inf):
            raise ValueError(
                f"window and resolution_time must be 0 s or more and tau above 0 s, not "
                f"{self.window:g}, {self.resolution_time:g} and {self.tau:g} s"
            )

    def share(self, clock: Clock) -> float:
        """Share of spikes at random phases that are read undecided."""
        return min(self.window * clock.hz, 1.0) * math.exp(-self.resolution_time / self.tau)

    def undecided(
        self,
        instants: npt.NDArray[np.int64],
        clock: Clock,
        pixels: npt.NDArray[np.uint32],
        spikes: npt.NDArray[np.uint64],
        seed: int,
    ) -> npt.NDArray[np.bool_]:
        """Finds the spikes that are read undecided.

        The latch of spike k settles after -tau log u. u has 64 bits, from counter (pixel, k high,
        k low, 0) with key (seed, METASTABILITY), and so depends on nothing else.

        Args:
            instants: (n,) spike times, ps.
            clock: clock of the latches.
            pixels: (n,) number of each spike's pixel.
            spikes: (n,) index of each spike within its pixel.
            seed: seed of the run.

        Returns:
            (n,) bool.

        Raises:
            ValueError: an instant overflows 64 bits on this clock.
        """
        # The position in cycles is instant x a / b in lowest terms.
        step = clock.position(1)
        a, b = step.numerator, step.denominator
        if instants.size and int(np.abs(instants).max()) > (2**63 - 1) // a:
            raise ValueError(f"instants must stay below {(2**63 - 1) // a} ps on {clock}")
        phase = (instants * a) % b / b
        undecided = np.minimum(phase, 1 - phase) < self.window * clock.hz / 2
        inside = np.flatnonzero(undecided)
        k = spikes[inside]
        counter = (pixels[inside], k >> np.uint64(32), k & np.uint64(0xFFFFFFFF), 0)
        high, low, _, _ = philox4x32(counter, (seed, Stream.METASTABILITY))
        u = (high + (low + 0.5) * 2.0**-32) * 2.0**-32
        undecided[inside] = -self.tau * np.log(u) > self.resolution_time
        return np.asarray(undecided)
