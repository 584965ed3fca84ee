"""What a display costs: a renderer on the words of a few blocks."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import display
from cosim import Block
from cosim.viform import Words
from display import DisplaySetting, PlainRenderer

__all__ = ["display_ns", "golden_ns"]

PIECE = 1 << 14
"""Pixels that the golden model is timed on: it takes the same for each."""


def golden_ns(setting: DisplaySetting, shown: Sequence[tuple[Block, Words]]) -> float:
    """Nanoseconds a pixel-plane of the golden model."""
    return _time(PlainRenderer, setting, shown, PIECE)


def display_ns(kind: str, setting: DisplaySetting, shown: Sequence[tuple[Block, Words]]) -> float:
    """The same of the renderer of this kind (`gl`, `numpy`). shown: what is shown, block by block;
    the first warms up where there is another."""
    make: Any = getattr(display, "make_renderer", None)
    if kind == "numpy" or make is None:
        return golden_ns(setting, shown)
    return _time(lambda *given: make(kind, *given), setting, shown, math.inf)


def _time(
    make: Any, setting: DisplaySetting, shown: Sequence[tuple[Block, Words]], most: float
) -> float:
    """Seconds from the first step to the first image, over planes and pixels: what a renderer has
    put off is done by then."""
    height, width = shown[0][1].shape[1:]
    rows = height if most == math.inf else max(1, min(height, int(most) // width))
    # The stream's own size: what a panel of another costs is the same a pixel.
    panel = replace(setting.shown, shape=(rows, width))
    ready = replace(setting, panel=panel)
    renderer = make(panel, setting.batch, setting.observer.images)
    try:
        timed = list(shown[1:]) or list(shown)
        for blocks in (shown[:1], timed):
            begin, planes = time.perf_counter(), 0
            for block, words in blocks:
                part = words if rows == height else words[:, :rows]
                renderer.step(part, block.cycles, ready.views(block.start, block.cycles))
                planes += block.cycles
            renderer.take(0)
            spent = time.perf_counter() - begin
    finally:
        renderer.close()
    return spent * 1e9 / (rows * width * planes)
