"""Creates the renderer of a panel by its name in a scenario."""

from __future__ import annotations

import moderngl

from cosim import InputError
from cosim.compute.opencl import Device, open_device
from display.panels.panel import SpikePanel
from display.render.context import open_context, software
from display.render.golden import GoldenRenderer
from display.render.kinds import RendererKind
from display.render.opencl import OpenCLRenderer
from display.render.renderer import Renderer

DRAW = 128
"""Maximum number of planes in a step of a renderer."""
AnyRenderer = Renderer | OpenCLRenderer | GoldenRenderer


def make_renderer(
    kind: RendererKind,
    panel: SpikePanel,
    batch: int,
    images: int,
    context: moderngl.Context | None = None,
    device: Device | None = None,
) -> AnyRenderer:
    """Creates a renderer; the caller closes it.

    Args:
        kind: "gl" for shaders, which need GL 3.3; "opencl" for kernels, which are faster on a
            processor; "auto" for shaders if GL is on a GPU, else for kernels if there is an OpenCL
            device, unless it is a GPU beside a software GL; "numpy" for the golden model, which is
            slow.
        panel: the panel.
        batch: number of planes in a span of light.
        images: number of images of the observers.
        context: GL context of the shaders, None for a new context.
        device: OpenCL device of the kernels, None for the default one.

    Raises:
        InputError: GL 3.3 is not available ("gl"), or OpenCL is not ("opencl"), or neither is
            ("auto").
    """
    if kind == "numpy":
        return GoldenRenderer(panel, batch, images)
    if kind == "opencl":
        return OpenCLRenderer(panel, batch, images, device)
    if kind == "auto" and (slow := _slow_gl(context)) is not False:
        try:
            device = device or open_device()
        except InputError:  # software GL is slow, but it works
            return Renderer(panel, batch, images, context)
        if slow is None or not device.gpu:  # the kernels are written for processors
            return OpenCLRenderer(panel, batch, images, device)
    return Renderer(panel, batch, images, context)


def _slow_gl(context: moderngl.Context | None) -> bool | None:
    """Whether this context, or a new one, is software; None if there is no GL."""
    if context is not None:
        return software(context)
    try:
        own = open_context()
    except InputError:
        return None
    try:
        return software(own)
    finally:
        own.release()
