"""Names of the renderers in a scenario; importing them does not import GL."""

from __future__ import annotations

from typing import Literal

__all__ = ["RendererKind"]

RendererKind = Literal["auto", "gl", "opencl", "numpy"]
