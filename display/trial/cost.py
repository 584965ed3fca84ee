"""What a display costs: a renderer on the words of a few blocks."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from cosim import Block
from cosim.spikes.viform import WORD, Words
from display.render.factory import DRAW, make_renderer
from display.render.golden import GoldenRenderer
from display.setting import DisplaySetting

__all__ = ["display_ns", "golden_ns"]

PIECE = 1 << 13
"""Pixels that the golden model is timed on: it takes the same for each."""
REPEATS = 3


def golden_ns(setting: DisplaySetting, blocks: Sequence[tuple[Block, Words]]) -> float:
    """Nanoseconds a pixel-plane of the golden model."""
    return _time(GoldenRenderer, setting, blocks, PIECE)


def display_ns(
    kind: Literal["gl", "numpy"], setting: DisplaySetting, blocks: Sequence[tuple[Block, Words]]
) -> float:
    """The same of the renderer of this kind (`gl`, `numpy`). blocks: words, block by block."""
    if kind == "numpy":
        return golden_ns(setting, blocks)
    return _time(lambda *given: make_renderer(kind, *given), setting, blocks, math.inf)


def _draws(blocks: Sequence[tuple[Block, Words]]) -> list[tuple[Block, Words]]:
    """Blocks that follow each other, joined up to what a run draws at once."""
    draws: list[tuple[Block, Words]] = []
    for block, words in blocks:
        if draws and draws[-1][0].stop == block.start and draws[-1][0].cycles % WORD == 0:
            before, held = draws[-1]
            if before.cycles + block.cycles <= DRAW:
                joined = np.concatenate([held, words])
                draws[-1] = Block(before.start, before.cycles + block.cycles), joined
                continue
        draws.append((block, words))
    return draws


def _time(
    make: Any, setting: DisplaySetting, blocks: Sequence[tuple[Block, Words]], most: float
) -> float:
    """From the first step to an image, by when everything that a renderer has put off is done; the
    least of several times through the same planes, after one that compiles what they need."""
    height, width = blocks[0][1].shape[1:]
    rows = height if most == math.inf else max(1, min(height, int(most) // width))
    # The stream's own size: what a panel of another costs is the same a pixel.
    panel = replace(setting.simulated_panel, shape=(rows, width))
    ready = replace(setting, panel=panel)
    draws = [
        (block, np.ascontiguousarray(words[:, :rows]), ready.views(block.start, block.cycles))
        for block, words in _draws(blocks)
    ]
    renderer = make(panel, setting.batch, setting.observer.images)
    took = []
    try:
        for _ in range(1 + REPEATS):
            begin = time.perf_counter()
            for block, words, views in draws:
                renderer.step(words, block.cycles, views)
            renderer.take(0)
            took.append(time.perf_counter() - begin)
    finally:
        renderer.close()
    return min(took[1:]) * 1e9 / (rows * width * sum(block.cycles for block, *_ in draws))
