"""The renderer of a panel, by its name in a scenario."""

from __future__ import annotations

from typing import Literal

import moderngl

from display.panels.panel import SpikePanel
from display.render.golden import GoldenRenderer
from display.render.renderer import Renderer

__all__ = ["DRAW", "AnyRenderer", "make_renderer"]

DRAW = 128
"""Planes that a renderer is given at once, at most."""
AnyRenderer = Renderer | GoldenRenderer


def make_renderer(
    kind: Literal["gl", "numpy"],
    panel: SpikePanel,
    batch: int,
    images: int,
    context: moderngl.Context | None = None,
) -> AnyRenderer:
    """Makes a renderer; the caller closes it.

    Args:
        kind: "gl" for shaders, which need GL 3.3, or "numpy" for the golden model, which is slow.
        panel: what is shown.
        batch: planes to a span of light.
        images: number of images that observers take.
        context: GL context that shaders run in, None for a context of their own.

    Raises InputError if there is no GL 3.3.
    """
    return (
        Renderer(panel, batch, images, context)
        if kind == "gl"
        else GoldenRenderer(panel, batch, images)
    )
