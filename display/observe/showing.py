"""From a scenario's [display] section to the panels and the observers."""

from __future__ import annotations

from collections.abc import Sequence

from cosim import Clock, InputError, seconds_to_ps
from display import CameraPlane, FixedEye, FramePanel, Projector, PursuingEye, SpikePanel
from display.section import DisplaySection
from sensor import CameraSetting

__all__ = ["beside_of", "key_of", "observers_of", "panel_of"]


def panel_of(section: DisplaySection, setting: CameraSetting, white_rate: float) -> SpikePanel:
    """The spike-continuous panel that shows this camera's stream. white_rate: spikes a cycle."""
    chip = setting.chip
    shape = section.height or chip.height, section.width or chip.width
    if section.fit == "exact" and shape != (chip.height, chip.width):
        raise InputError(
            "display.width and display.height",
            f"the stream's {chip.width} x {chip.height}",
            f"{shape[1]} x {shape[0]}",
            "leave them out, or set display.fit=nearest or centre",
        )
    if section.row_scan < setting.row_skew:
        raise InputError(
            "display.row_scan",
            f"at least sensor.row_skew, {setting.row_skew:g}",
            f"{section.row_scan:g}: rows would be shown before they are sampled",
            "raise it",
        )
    return SpikePanel(
        shape, setting.clock, white_rate, section.drive, section.pulse, section.rise,
        section.decay, section.row_scan, seconds_to_ps(section.transport), section.fill,
        section.luminance,
    )  # fmt: skip


def beside_of(section: DisplaySection) -> list[FramePanel | Projector]:
    """The panels beside it."""
    panels: list[FramePanel | Projector] = [
        FramePanel(Clock.from_hz(rate), section.persistence, section.response)
        for rate in section.beside
    ]
    if section.projector > 0:
        panels.append(Projector(Clock.from_hz(section.projector)))
    return panels


def key_of(display: str) -> str:
    """A display's name within the name of a metric: "60 Hz" is 60hz, "16 kHz binary" projector."""
    if display.endswith(" binary"):
        return "projector"
    return display.replace(" ", "").replace(".", "_").lower()


def observers_of(
    section: DisplaySection, instants: Sequence[int], end: int, velocity: float
) -> dict[str, FixedEye | PursuingEye | CameraPlane]:
    """Every observer by its name in the section. instants: ps. end: of the run, ps. velocity: of
    the pursuing eye, pixels a second along the rows."""
    eye = FixedEye(tuple(instants), section.luminance, 0, end)
    return {
        "eye": eye,
        "pursuit": PursuingEye(eye, (0.0, velocity)),
        "camera": CameraPlane(tuple(instants), seconds_to_ps(section.exposure)),
    }
