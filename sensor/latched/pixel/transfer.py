"""A pointwise map of the charge that a cycle brings, before it is accumulated.

A light-dependent gain or a saturation is such a map. Each tier computes it in its own arithmetic:
the reference tier in float64, the exact tier in Q24.40 integers, the fast tier in float32. numpy
and OpenCL must give the same bits in the last two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sensor.latched.pixel.fixed_point import LARGEST, ONE, Charge
from sensor.latched.pixel.span import Span

__all__ = ["Transfer", "charge_source", "light_source", "transferred", "transferred_light"]


@dataclass(frozen=True, eq=False)
class Transfer:
    """A pointwise map x -> T(x) of a cycle's charge, x >= 0, T(x) >= 0, not falling.

    Attributes:
        share: numpy form for light in units of the nominal threshold, of float64 (reference tier)
            or float32 (fast tier) arrays; constants must be Python floats that float32 holds.
        charge: numpy form for Q24.40 charge up to LARGEST, of int64 arrays.
        share_cl: body of an OpenCL function float16 -> float16 of `x`, with one rounding an
            operation, in the same order as `share`.
        charge_cl: body of an OpenCL function long16 -> long16 of `x`.
        least, most: limits of T(x) / x over all x.
    """

    share: Callable[[Any], Any]
    charge: Callable[[Charge], Charge]
    share_cl: str
    charge_cl: str
    least: float = 1.0
    most: float = 1.0


def _charge(transfers: Sequence[Transfer], charge: Charge) -> Charge:
    for transfer in transfers:
        charge = np.minimum(transfer.charge(charge), LARGEST * ONE)
    return charge


def transferred(spans: Iterable[Span], transfers: Sequence[Transfer]) -> Iterator[Span]:
    """The same spans with the charge mapped; light that changes becomes a span a cycle."""
    for span in spans:
        if span.slope is None:
            yield replace(span, charge=_charge(transfers, span.charge))
            continue
        for i in range(span.cycles):
            charge = span.charge + span.slope * (span.elapsed + i)
            yield Span(span.first + i, 1, _charge(transfers, charge))


def _chained(bodies: Iterable[str], kind: str, name: str, after: str) -> str:
    """OpenCL functions of the maps, and one that applies them in turn."""
    text, calls = "", ""
    for n, body in enumerate(bodies):
        text += f"inline {kind} {name}_{n}(const {kind} x)\n{{\n{body}\n}}\n"
        calls += f"    x = {after.format(f'{name}_{n}(x)')};\n"
    return f"{text}inline {kind} {name}({kind} x)\n{{\n{calls}    return x;\n}}\n"


def charge_source(transfers: Sequence[Transfer]) -> str:
    """OpenCL text that defines `long16 transfer(long16)` in Q24.40."""
    most = f"min({{}}, (long16)({LARGEST * ONE}L))"
    return _chained((t.charge_cl for t in transfers), "long16", "transfer", most)


def light_source(transfers: Sequence[Transfer], ratio: float) -> str:
    """OpenCL text that defines `float16 transfer(float16)`.

    ratio: nominal thresholds in a unit of its argument and result.
    """
    scaled = "" if ratio == 1 else f" * {float(np.float32(ratio)).hex()}f"
    back = "" if ratio == 1 else f" * {float(np.float32(1 / ratio)).hex()}f"
    text = _chained((t.share_cl for t in transfers), "float16", "in_thresholds", "{}")
    return (
        "#pragma OPENCL FP_CONTRACT OFF\n" + text + "inline float16 transfer(const float16 x)\n"
        f"{{\n    return in_thresholds(x{scaled}){back};\n}}\n"
    )


def transferred_light(transfers: Sequence[Transfer], light: Any, ratio: float) -> Any:
    """`transfer` of `light_source` for arrays of float32 or float64, in their own precision."""
    kind = light.dtype.type
    if ratio != 1:
        light = light * kind(np.float32(ratio))
    for transfer in transfers:
        light = transfer.share(light)
    return light if ratio == 1 else light * kind(np.float32(1 / ratio))
