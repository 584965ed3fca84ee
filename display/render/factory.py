"""Creates the renderer of a panel by its name in a scenario."""

from __future__ import annotations

from typing import Literal

import moderngl

from display.panels.panel import SpikePanel
from display.render.golden import GoldenRenderer
from display.render.renderer import Renderer

__all__ = ["DRAW", "AnyRenderer", "make_renderer"]

DRAW = 128
"""Maximum number of planes in a step of a renderer."""
AnyRenderer = Renderer | GoldenRenderer


def make_renderer(
    kind: Literal["gl", "numpy"],
    panel: SpikePanel,
    batch: int,
    images: int,
    context: moderngl.Context | None = None,
) -> AnyRenderer:
    """Creates a renderer; the caller closes it.

    Args:
        kind: "gl" for shaders, which need GL 3.3, or "numpy" for the golden model, which is slow.
        panel: the panel.
        batch: number of planes in a span of light.
        images: number of images of the observers.
        context: GL context of the shaders, None for a new context.

    Raises:
        InputError: GL 3.3 is not available.
    """
    return (
        Renderer(panel, batch, images, context)
        if kind == "gl"
        else GoldenRenderer(panel, batch, images)
    )
