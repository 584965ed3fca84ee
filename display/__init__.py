"""Spikes to light: panels, the renderer, observers, and how good what they see is."""

from display.observers import CameraPlane, FixedEye, PursuingEye
from display.panel import DRIVES, Drive, FramePanel, Projector, SpikePanel
from display.plain import PlainRenderer
from display.setting import DisplaySetting
from display.views import Observer, Views, panel_views

__all__ = [
    "DRIVES", "CameraPlane", "DisplaySetting", "Drive", "FixedEye", "FramePanel", "Observer",
    "PlainRenderer", "Projector", "PursuingEye", "SpikePanel", "Views", "panel_views",
]  # fmt: skip
