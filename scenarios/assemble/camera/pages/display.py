"""The page of a run with a latched camera and a display."""

from __future__ import annotations

from cosim.config.amounts import count, number
from cosim.run.machine import Page
from scenarios.assemble.behind.display.sections import (
    display_cards,
    display_quality,
    display_sections,
    display_simulated,
)
from scenarios.assemble.behind.display.shown import Shown
from scenarios.assemble.camera.judged import LatchedRun
from scenarios.assemble.camera.pages.chip import machine
from scenarios.assemble.camera.pages.motion import motion_section
from scenarios.assemble.camera.pages.plan import plan_section
from scenarios.assemble.camera.pages.stream import simulated


def _subtitle(run: LatchedRun, shown: Shown) -> str:
    panel = shown.outcome.chain.panel
    return (
        f"{run.setting.chip.title}, {number(run.setting.clock.hz / 1e3)} kHz, "
        f"{count(run.stream.cycles)} cycles; {panel.shape[1]} x {panel.shape[0]} spike-continuous "
        f"panel, {panel.drive}, {number(panel.luminance)} cd/m², drawn by {run.result.renderer}"
    )


def display_page(run: LatchedRun) -> Page:
    """The page of a run with a display; writes its figures and glass.mp4."""
    assert run.display is not None
    shown = Shown(
        run.run, run.display, run.setting.clock, run.instants, run.stream, run.filmer
    )  # fmt: skip
    body, (overview, *files) = display_sections(shown)
    files, clip = files[:-1], files[-1]
    if run.scenario.sensor.source is None:
        files.append("figures/plan.png")
    sections = [*body, motion_section(run.source), plan_section(run), machine(run)]
    return Page(
        run.scenario.title, _subtitle(run, shown), f"{simulated(run)} {display_simulated(shown)}",
        display_cards(shown), sections, good="How good camera and display are together",
        quality=display_quality(shown), files=[overview, *files, clip],
    )  # fmt: skip
