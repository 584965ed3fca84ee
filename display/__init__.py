"""Spikes to light: panels, the renderer, observers, and how good what they see is."""

from display.observe.integration import LightPlanes, ObserverImages, Span
from display.observe.observers import CameraPlane, FixedEye, PursuingEye, eye_time
from display.observe.temporal import STAGES
from display.observe.views import Observer, Views, panel_views
from display.panels.fit import Fit, fit_words
from display.panels.panel import FramePanel, Projector, SpikePanel
from display.references.frames import FrameShow
from display.references.projector import ProjectorShow, spread_errors
from display.references.truth import TruthShow
from display.render.context import GL_INSTALL, probe_gl
from display.render.factory import AnyRenderer, make_renderer
from display.render.golden import GoldenRenderer
from display.render.plane_by_plane import PlaneByPlane
from display.render.renderer import Renderer
from display.setting import DisplaySetting
from display.window import Window, open_window

__all__ = [
    "GL_INSTALL",
    "STAGES",
    "AnyRenderer",
    "CameraPlane",
    "DisplaySetting",
    "Fit",
    "FixedEye",
    "FramePanel",
    "FrameShow",
    "GoldenRenderer",
    "LightPlanes",
    "Observer",
    "ObserverImages",
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
