"""Spikes to light: panels, the renderer, observers, and how good what they see is."""

from display.context import GL_INSTALL, probe_gl
from display.fit import Fit, fit_words
from display.making import AnyRenderer, make_renderer
from display.observers import CameraPlane, FixedEye, PursuingEye
from display.panel import DRIVES, Drive, FramePanel, Projector, SpikePanel
from display.plain import PlainRenderer
from display.plane_by_plane import PlaneByPlane
from display.renderer import Renderer
from display.views import Observer, Views, panel_views
from display.window import Window, open_window

__all__ = [
    "DRIVES", "GL_INSTALL", "AnyRenderer", "CameraPlane", "Drive", "Fit", "FixedEye", "FramePanel",
    "Observer", "PlainRenderer", "PlaneByPlane", "Projector", "PursuingEye", "Renderer",
    "SpikePanel", "Views", "Window", "fit_words", "make_renderer", "open_window", "panel_views",
    "probe_gl",
]  # fmt: skip
