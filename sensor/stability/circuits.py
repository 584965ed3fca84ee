"""Cases 7, 13 and 14: the stiff pixel's closed forms where they lose digits or miss a crossing.

References are closed forms in fifty decimal digits, of the very numbers the method is given.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal, localcontext
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.run.case import Case
from sensor.circuit.circuit import ELEMENTARY_CHARGE, Circuit
from sensor.circuit.phases import spike_train

Values = npt.NDArray[np.float64]
Train = Callable[[Circuit, Values, Values, Values, Values], Values]
"""(circuit, knots in s, electrons a second at the start and end of each piece, thresholds in
electrons) -> instants of the spikes in s."""
DIGITS: Final = 50
FARAD: Final = 5e-15
Q: Final = 18_725.0
"""Electrons: 0.6 V on 5 fF."""


def shipped(device: Device | None) -> Train:
    """The closed forms; they are compiled for the processor whatever the device."""
    return spike_train


def steady(train: Train, circuit: Circuit, rate: float, stop: float, count: int) -> Values:
    """Spikes under steady light until `stop` (s)."""
    light = np.array([rate])
    return train(circuit, np.array([0.0, stop]), light, light, np.full(count, Q))


def leaky_interval(rate: float, tau: float) -> Decimal:
    """-tau ln(1 - Q / (rate tau)) seconds, Q / rate without a leak; infinite where the leak holds
    the charge below Q. To be called with enough digits."""
    if math.isinf(tau):
        return Decimal(Q) / Decimal(rate)
    inside = 1 - Decimal(Q) / (Decimal(rate) * Decimal(tau))
    return -Decimal(tau) * inside.ln() if inside > 0 else Decimal("Infinity")


# 7 -------------------------------------------------------------------------------------------


def currents(train: Train, spikes: int = 20) -> float:
    """Largest relative error of a spike's instant, 1e-18 to 1e-9 A; without a leak, with one of
    1e15 s, and with one that takes half the light."""
    worst = 0.0
    with localcontext() as context:
        context.prec = DIGITS
        for decade in range(-18, -8):
            rate = 10.0**decade / ELEMENTARY_CHARGE
            for tau in (math.inf, 1e15, 2 * Q / rate):
                one = leaky_interval(rate, tau)
                circuit = Circuit(FARAD, leak=tau)
                times = steady(train, circuit, rate, float(one) * (spikes + 0.5), spikes)
                if times.size != spikes:
                    return math.inf
                for k, t in enumerate(times.tolist(), 1):
                    worst = max(worst, float(abs(Decimal(t) / (k * one) - 1)))
    return worst


# 13 ------------------------------------------------------------------------------------------


def equilibrium(train: Train) -> float:
    """Largest relative error of the first spike where the leak's equilibrium is a share 1e-12 to
    1e-3 above the threshold; infinite where a spike comes that never can, or one is missed."""
    worst = 0.0
    with localcontext() as context:
        context.prec = DIGITS
        for tau in (1e-3, 10.0):
            circuit = Circuit(FARAD, leak=tau)
            for share in (1e-3, 1e-6, 1e-9, 1e-12):
                for side in (-share, share):
                    rate = Q * (1 + side) / tau
                    due = leaky_interval(rate, tau)
                    times = steady(train, circuit, rate, 1000 * tau, 1)
                    if bool(times.size) != due.is_finite():
                        return math.inf
                    if times.size:
                        worst = max(worst, float(abs(Decimal(float(times[0])) / due - 1)))
    return worst


# 14 ------------------------------------------------------------------------------------------


def _fading(rate: float, stop: float, tau: float) -> tuple[Callable[[Decimal], Decimal], Decimal]:
    """Charge at an instant under light that fades from `rate` to 0 at `stop`, and the instant at
    which it is greatest."""
    r, s, u = Decimal(rate), -Decimal(rate) / Decimal(stop), Decimal(tau)

    def charge(t: Decimal) -> Decimal:
        gone = 1 - (-t / u).exp()
        return r * u * gone + s * u * (t - u * gone)

    return charge, u * (1 - r / (s * u)).ln()


def grazing(train: Train) -> float:
    """Largest relative error of a spike whose charge passes the threshold by a share 1e-12 to 1e-3
    and turns back; infinite where it is missed, or comes where the charge stays below."""
    worst = 0.0
    with localcontext() as context:
        context.prec = DIGITS
        for tau in (1e-4, 1e-3, 1e-2):
            rate, stop = 1.0e8, 2e-3
            charge, top = _fading(rate, stop, tau)
            peak = charge(top)
            for share in (1e-3, 1e-6, 1e-9, 1e-12):
                for side in (1 - Decimal(share), 1 + Decimal(share)):
                    goal = float(peak * side)
                    times = train(
                        Circuit(FARAD, leak=tau), np.array([0.0, stop]), np.array([rate]),
                        np.array([0.0]), np.array([goal]),
                    )  # fmt: skip
                    if times.size != (Decimal(goal) <= peak):
                        return math.inf
                    if not times.size:
                        continue
                    low, high = Decimal(0), top
                    for _ in range(120):
                        middle = (low + high) / 2
                        if charge(middle) < Decimal(goal):
                            low = middle
                        else:
                            high = middle
                    worst = max(worst, float(abs(Decimal(float(times[0])) / high - 1)))
    return worst


CIRCUITS: Final = (
    Case(
        7,
        "1e-18 to 1e-9 A",
        "20 spikes in every decade of current, without a leak and with one",
        "closed form in 50 digits",
        "log for log1p; float32 time; coulombs at default tolerances",
        "relative",
        1e-12,
        currents,
        shipped,
    ),
    Case(
        13,
        "leak equilibrium at the threshold",
        "a spike at V_th (1 + 1e-12), none at V_th (1 - 1e-12)",
        "closed form in 50 digits; 1e-12 of float64 leaves 1e-5 of the instant",
        "a solver at default tolerances",
        "relative",
        1.5e-5,
        equilibrium,
        shipped,
    ),
    Case(
        14,
        "grazing dip",
        "a crossing that turns back after a share of 1e-12 is found, a near miss is none",
        "closed form in 50 digits, bisected",
        "change of sign from step to step",
        "relative",
        1e-8,
        grazing,
        shipped,
    ),
)
