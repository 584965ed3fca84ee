"""From spikes to light: panels, renderers, observers, and the quality of the observed light."""

from display.observe.observers import CameraPlane, FixedEye, PursuingEye
from display.observe.views import panel_views
from display.panels.panel import SpikePanel, fit_words
from display.render.context import GL_INSTALL, probe_gl
from display.render.factory import make_renderer
from display.render.plane_by_plane import PlaneByPlane
from display.setting import DisplaySetting
from display.window import Window, open_window

__all__ = [
    "GL_INSTALL", "CameraPlane", "DisplaySetting", "FixedEye", "PlaneByPlane", "PursuingEye",
    "SpikePanel", "Window", "fit_words", "make_renderer", "open_window", "panel_views",
    "probe_gl",
]  # fmt: skip
