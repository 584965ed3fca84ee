"""Spikes to light: panels, the renderer, observers, and how good what they see is."""

from display.context import GL_INSTALL, probe_gl
from display.fit import Fit, fit_words
from display.frames import FrameShow
from display.making import AnyRenderer, make_renderer
from display.observers import CameraPlane, FixedEye, PursuingEye, eye_time
from display.onlooker import Lit, Onlooker, Span
from display.panel import DRIVES, Drive, FramePanel, Projector, SpikePanel
from display.plain import PlainRenderer
from display.plane_by_plane import PlaneByPlane
from display.projector import ProjectorShow, spread_errors
from display.renderer import Renderer
from display.setting import DisplaySetting
from display.temporal import STAGES
from display.truth import TruthShow
from display.views import Observer, Views, panel_views
from display.window import Window, open_window

__all__ = [
    "DRIVES",
    "GL_INSTALL",
    "STAGES",
    "AnyRenderer",
    "CameraPlane",
    "DisplaySetting",
    "Drive",
    "Fit",
    "FixedEye",
    "FramePanel",
    "FrameShow",
    "Lit",
    "Observer",
    "Onlooker",
    "PlainRenderer",
    "PlaneByPlane",
    "Projector",
    "ProjectorShow",
    "PursuingEye",
    "Renderer",
    "Span",
    "SpikePanel",
    "TruthShow",
    "Views",
    "Window",
    "eye_time",
    "fit_words",
    "make_renderer",
    "open_window",
    "panel_views",
    "probe_gl",
    "spread_errors",
]  # fmt: skip
