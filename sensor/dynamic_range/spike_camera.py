"""The dynamic range of a spike camera, and what its threshold and widths resolve (Huang, "Spiking
Continuous Photographing Principle", Acta Electronica Sinica 50:2919, 2022, sections 3.3.2 to 5.2).

A pixel gathers Q electrons in a width tau, so light is Q/tau. The shortest width is what the
circuit can read out, the longest what dark current leaves of it: Q/I_dark.
"""

from __future__ import annotations

import math

from cosim.light.radiometry import photons_per_lux
from sensor.dynamic_range.parts import as_ratio, decibels


def spike_dynamic_range(longest: float, shortest: float, levels: float = 1) -> float:
    """20 lg(longest/shortest N), dB (sections 4.4 and 4.5): widths in one unit of time; levels: N
    of the charge read below threshold when the longest width is up, 1 for none."""
    return decibels(longest / shortest * levels)


def levels_for(db: float, longest: float, shortest: float) -> float:
    """N that a dynamic range takes when a width may be no longer than this: 10 for 180 dB at 1 s
    and 10 ns. At 0.1 s it is 100, where section 4.5 prints 10."""
    return as_ratio(db) / (longest / shortest)


def photons_per_second(lux: float, square_micrometres: float) -> float:
    """Photons a second on a pixel, as of 555 nm (section 4.3)."""
    return photons_per_lux(555) * lux * square_micrometres * 1e-12


def threshold_for(electrons_per_second: float, shortest: float) -> float:
    """The least Q with which a circuit of this shortest width, seconds, follows the light."""
    return electrons_per_second * shortest


def longest_width(threshold: float, dark: float) -> float:
    """Seconds after which a width is dark current's rather than light's: Q/I_dark (section 4.4).
    dark: electrons a second."""
    return threshold / dark


def level_step(width: int) -> float:
    """Light between widths of tau and tau + 1 ticks, in Q a tick: 1/(tau (tau + 1)) (3.3.2)."""
    return 1 / (width * (width + 1))


def interval_rsd(threshold: float) -> float:
    """Standard deviation of a width over the width, from shot noise alone: sqrt(1/Q) (5.1)."""
    return math.sqrt(1 / threshold)
