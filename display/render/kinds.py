"""Names of the renderers in a scenario; importing them does not import GL."""

from __future__ import annotations

from typing import Literal

RendererKind = Literal["auto", "gl", "opencl", "numpy"]
