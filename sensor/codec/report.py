"""The report's section on the size of the stream."""

from __future__ import annotations

from cosim.config.amounts import count, number
from sensor.codec.size import REFINE, K, Sizes


def size_text(sizes: Sizes) -> str:
    """What was measured, in a sentence or two."""
    what = (
        "the whole stream"
        if sizes.pixels == sizes.all_pixels
        else f"a sample, {count(sizes.pixels)} of its {count(sizes.all_pixels)} pixels"
    )
    return (
        f"Measured on {what}. A first-spike code sends a spike only when the width changes (Huang "
        "2022, section 5.2). repeat and line lose nothing (viform convert RUN out.fsc); "
        f"statistical drops changes within {number(K)} standard deviations of a width "
        f"and sends the mean of the {REFINE} widths after each that it does not."
    )


def size_rows(sizes: Sizes) -> list[list[str]]:
    """Rows of the table: form, bits a pixel and cycle, share of raw."""
    named = (
        ("raw, one bit a pixel and cycle", 1.0),
        ("zstd level 3 of that, in the order that is best", sizes.zstd),
        ("first spikes: repeat, the paper's rule", sizes.repeat),
        ("first spikes: line, residual-carrying pixels", sizes.line),
        (f"first spikes: statistical, k = {K:g}, means of {REFINE} (lossy)", sizes.statistical),
    )
    return [[name, number(size), number(1 / size) if size else "any"] for name, size in named]
