"""Charge in Q24.40, as a 64-bit integer in units of 2^-40 electrons; that of a span of cycles, and
pointwise maps of it before accumulation.

In float32 the charge of a dim pixel is lost to rounding, and float64 sums depend on their order;
integers avoid both. Charge, increments and thresholds stay below 2^21 electrons, so sums of a few
of them do not overflow.

A light-dependent gain or a saturation is a pointwise map. The reference tier computes it in
float64, the exact tier in Q24.40 integers, and the fast tier in float32. In the last two, numpy and
OpenCL must give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Charge = npt.NDArray[np.int64]

FRACTION_BITS: Final = 40
ONE: Final = 1 << FRACTION_BITS
"""Unit of one electron."""
LARGEST: Final = 1 << 21
"""Upper limit in electrons of a threshold, and of the charge that a cycle adds. Brighter light is
clipped to it; such a pixel fires in every cycle, whatever its threshold."""


def to_fixed(electrons: Any) -> Charge:
    """Nearest Q24.40 to float64 `electrons`, clipped to LARGEST."""
    value = np.minimum(np.asarray(electrons, np.float64), LARGEST)
    return np.rint(value * float(ONE)).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Span:
    """Charge in cycles `first` to `first + cycles` of a block, constant or linear in time.

    The charge of cycle c is charge + slope x (c - first + elapsed).

    Attributes:
        first: first cycle, within the block.
        cycles: number of cycles.
        charge: (n,) int64 >= 0, Q24.40 in the cycle in which this course of light began.
        slope: (n,) int64, its change a cycle; None if constant.
        elapsed: cycles from that cycle to `first`, so that all blocks share the arrays.
        advance: (n,) int64, charge by which the comparison at the end of the single cycle is early,
            because of timing noise of the pixels; None for none. It is compared and not kept.
    """

    first: int
    cycles: int
    charge: Charge
    slope: Charge | None = None
    elapsed: int = 0
    advance: Charge | None = None


@dataclass(frozen=True, eq=False)
class Transfer:
    """A pointwise, non-decreasing map x -> T(x) of a cycle's charge, x >= 0, T(x) >= 0.

    Attributes:
        share: numpy form, for charge in units of the nominal threshold, float64 (reference tier) or
            float32 (fast tier). Constants must be Python floats that float32 represents exactly.
        charge: numpy form, for int64 Q24.40 charge up to LARGEST.
        share_cl: body of an OpenCL function float16 -> float16 of `x`. It rounds after each
            operation, in the same order as `share`.
        charge_cl: body of an OpenCL function long16 -> long16 of `x`.
        least, most: lower and upper limit of T(x) / x over all x.
    """

    share: Callable[[Any], Any]
    charge: Callable[[Charge], Charge]
    share_cl: str
    charge_cl: str
    least: float = 1.0
    most: float = 1.0


def transferred(transfers: Sequence[Transfer], charge: Charge) -> Charge:
    """Q24.40 charge after all maps, each clipped to LARGEST."""
    for transfer in transfers:
        charge = np.minimum(transfer.charge(charge), LARGEST * ONE)
    return charge


def transfer_spans(spans: Iterable[Span], transfers: Sequence[Transfer]) -> Iterator[Span]:
    """The spans with their charge mapped; changing light becomes one span a cycle."""
    for span in spans:
        if span.slope is None:
            yield replace(span, charge=transferred(transfers, span.charge))
            continue
        for i in range(span.cycles):
            charge = span.charge + span.slope * (span.elapsed + i)
            yield Span(span.first + i, 1, transferred(transfers, charge))


def _chained(bodies: Iterable[str], kind: str, name: str, after: str) -> str:
    """OpenCL source of a function for each map, and of `name`, which applies them in turn."""
    text, calls = "", ""
    for n, body in enumerate(bodies):
        text += f"inline {kind} {name}_{n}(const {kind} x)\n{{\n{body}\n}}\n"
        calls += f"    x = {after.format(f'{name}_{n}(x)')};\n"
    return f"{text}inline {kind} {name}({kind} x)\n{{\n{calls}    return x;\n}}\n"


def charge_source(transfers: Sequence[Transfer]) -> str:
    """OpenCL source of `long16 transfer(long16)` in Q24.40."""
    most = f"min({{}}, (long16)({LARGEST * ONE}L))"
    return _chained((t.charge_cl for t in transfers), "long16", "transfer", most)


def light_source(transfers: Sequence[Transfer], ratio: float) -> str:
    """OpenCL source of `float16 transfer(float16)`.

    Args:
        transfers: maps, in their order.
        ratio: nominal thresholds per unit of the argument and the result.
    """
    scaled = "" if ratio == 1 else f" * {float(np.float32(ratio)).hex()}f"
    back = "" if ratio == 1 else f" * {float(np.float32(1 / ratio)).hex()}f"
    text = _chained((t.share_cl for t in transfers), "float16", "in_thresholds", "{}")
    return (
        "#pragma OPENCL FP_CONTRACT OFF\n" + text + "inline float16 transfer(const float16 x)\n"
        f"{{\n    return in_thresholds(x{scaled}){back};\n}}\n"
    )


def transfer_light(transfers: Sequence[Transfer], light: Any, ratio: float) -> Any:
    """numpy form of `light_source`, for float32 or float64 arrays, in their precision."""
    kind = light.dtype.type
    if ratio != 1:
        light = light * kind(np.float32(ratio))
    for transfer in transfers:
        light = transfer.share(light)
    return light if ratio == 1 else light * kind(np.float32(1 / ratio))
