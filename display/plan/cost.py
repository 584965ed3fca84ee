"""Measures the cost of a display: the time of a renderer for the words of a few blocks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cosim import Block
from cosim.run.timing import least
from cosim.spikes.viform import WORD, Words
from display.render.factory import DRAW, make_renderer
from display.render.golden import GoldenRenderer
from display.render.kinds import RendererKind
from display.setting import DisplaySetting

PIECE = 1 << 13
"""Maximum number of pixels on which the golden model is timed; its cost per pixel is constant."""
REPEATS = 3


def golden_ns(setting: DisplaySetting, blocks: Sequence[tuple[Block, Words]]) -> float:
    """Cost of the golden model, ns per pixel and plane."""
    return _time(GoldenRenderer, setting, blocks, PIECE)


def display_ns(
    kind: RendererKind, setting: DisplaySetting, blocks: Sequence[tuple[Block, Words]]
) -> float:
    """Cost of a renderer, ns per pixel and plane.

    Args:
        kind: name of the renderer.
        setting: the simulated display.
        blocks: blocks with their words.
    """
    if kind == "numpy":
        return golden_ns(setting, blocks)
    return _time(
        lambda panel, batch, images: make_renderer(kind, panel, batch, images),
        setting, blocks, math.inf,
    )  # fmt: skip


def _draws(blocks: Sequence[tuple[Block, Words]]) -> list[tuple[Block, Words]]:
    """Consecutive blocks, joined up to DRAW planes."""
    draws: list[tuple[Block, Words]] = []
    for block, words in blocks:
        if draws and draws[-1][0].stop == block.start and draws[-1][0].cycles % WORD == 0:
            before, earlier = draws[-1]
            if before.cycles + block.cycles <= DRAW:
                joined = np.concatenate([earlier, words])
                draws[-1] = Block(before.start, before.cycles + block.cycles), joined
                continue
        draws.append((block, words))
    return draws


def _time(
    make: Any, setting: DisplaySetting, blocks: Sequence[tuple[Block, Words]], most: float
) -> float:
    """Time from the first step to an image, which completes all deferred work of the renderer, ns
    per pixel and plane: the minimum of REPEATS passes, after one pass for compilation."""
    height, width = blocks[0][1].shape[1:]
    rows = height if most == math.inf else max(1, min(height, int(most) // width))
    # The size of the stream; the cost per pixel does not depend on the size of the panel.
    panel = replace(setting.simulated_panel, shape=(rows, width))
    ready = replace(setting, panel=panel)
    draws = [
        (block, np.ascontiguousarray(words[:, :rows]), ready.views(block.start, block.cycles))
        for block, words in _draws(blocks)
    ]
    renderer = make(panel, setting.batch, setting.observer.images)

    def show() -> None:
        for block, words, views in draws:
            renderer.step(words, block.cycles, views)
        renderer.take(0)

    try:
        seconds = least(show, REPEATS)
    finally:
        renderer.close()
    return seconds * 1e9 / (rows * width * sum(block.cycles for block, *_ in draws))
