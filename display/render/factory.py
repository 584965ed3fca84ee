"""Creates the renderer of a panel by its name in a scenario."""

from __future__ import annotations

import moderngl

from cosim import InputError
from cosim.compute.opencl import open_device
from display.panels.panel import SpikePanel
from display.render.context import open_context, software
from display.render.golden import GoldenRenderer
from display.render.kinds import RendererKind
from display.render.opencl import OpenCLRenderer
from display.render.renderer import Renderer

__all__ = ["DRAW", "AnyRenderer", "make_renderer"]

DRAW = 128
"""Maximum number of planes in a step of a renderer."""
AnyRenderer = Renderer | OpenCLRenderer | GoldenRenderer


def make_renderer(
    kind: RendererKind,
    panel: SpikePanel,
    batch: int,
    images: int,
    context: moderngl.Context | None = None,
) -> AnyRenderer:
    """Creates a renderer; the caller closes it.

    Args:
        kind: "gl" for shaders, which need GL 3.3; "opencl" for kernels, which are faster on a
            processor; "auto" for kernels if GL is software and there is an OpenCL device, else for
            shaders; "numpy" for the golden model, which is slow.
        panel: the panel.
        batch: number of planes in a span of light.
        images: number of images of the observers.
        context: GL context of the shaders, None for a new context.

    Raises:
        InputError: GL 3.3 is not available ("auto" and "gl"), or OpenCL is not ("opencl").
    """
    if kind == "numpy":
        return GoldenRenderer(panel, batch, images)
    if kind == "opencl":
        return OpenCLRenderer(panel, batch, images)
    if kind == "auto" and _software(context):
        try:
            device = open_device()
        except InputError:  # software GL is slow, but it works
            return Renderer(panel, batch, images, context)
        return OpenCLRenderer(panel, batch, images, device)
    return Renderer(panel, batch, images, context)


def _software(context: moderngl.Context | None) -> bool:
    """Whether the GL of this context, or of a new one, runs on the processor."""
    if context is not None:
        return software(context)
    own = open_context()
    try:
        return software(own)
    finally:
        own.release()
