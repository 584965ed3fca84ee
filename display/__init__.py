"""Spikes to light: panels, the renderer, observers, and how good what they see is."""

from display.frames import FrameShow
from display.observers import CameraPlane, FixedEye, PursuingEye
from display.onlooker import Lit, Onlooker, Span
from display.panel import DRIVES, Drive, FramePanel, Projector, SpikePanel
from display.plain import PlainRenderer
from display.projector import ProjectorShow
from display.truth import TruthShow
from display.views import Observer, Views, panel_views

__all__ = [
    "DRIVES", "CameraPlane", "Drive", "FixedEye", "FramePanel", "FrameShow", "Lit", "Observer",
    "Onlooker", "PlainRenderer", "Projector", "ProjectorShow", "PursuingEye", "Span", "SpikePanel",
    "TruthShow", "Views", "panel_views",
]  # fmt: skip
