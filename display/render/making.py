"""Which renderer shows a panel."""

from __future__ import annotations

from typing import Literal

import moderngl

from display.panels.panel import SpikePanel
from display.render.golden import PlainRenderer
from display.render.renderer import Renderer

__all__ = ["AnyRenderer", "make_renderer"]


AnyRenderer = Renderer | PlainRenderer


def make_renderer(
    kind: Literal["gl", "numpy"],
    panel: SpikePanel,
    batch: int,
    images: int,
    context: moderngl.Context | None = None,
) -> AnyRenderer:
    """gl: shaders, where this machine has GL 3.3 (InputError where not); numpy: the golden
    model, slow. Close it after use. context: that shaders run in, instead of one of their own."""
    return (
        Renderer(panel, batch, images, context)
        if kind == "gl"
        else PlainRenderer(panel, batch, images)
    )
