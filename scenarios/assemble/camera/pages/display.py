"""The page of a run with a latched camera and a display."""

from __future__ import annotations

import time

from cosim.report.parts import cards
from cosim.run.machine import Page
from scenarios.assemble.camera.judged import LatchedRun
from scenarios.assemble.camera.pages.chip import machine
from scenarios.assemble.camera.pages.motion import motion_section
from scenarios.assemble.camera.pages.plan import (
    error_card,
    full_physics_card,
    left_out_card,
    plan_section,
)
from scenarios.assemble.show.sections import display_cards, display_sections
from scenarios.assemble.show.shown import Shown

__all__ = ["display_page"]


def _cards(run: LatchedRun, shown: Shown) -> str:
    spent = time.perf_counter() - run.began
    return cards([
        *display_cards(shown),
        ("", f"{spent:.1f} s", f"run time, for {run.result.simulated_s * 1e3:.4g} ms of light"),
        ("", *error_card(run)),
        ("", *full_physics_card(run)),
        ("", *left_out_card(run)),
    ])  # fmt: skip


def _subtitle(run: LatchedRun, shown: Shown) -> str:
    panel = shown.outcome.chain.panel
    return (
        f"{run.setting.chip.title}, {run.setting.clock.hz / 1e3:g} kHz, {run.stream.cycles} cycles;"
        f" {panel.shape[1]} x {panel.shape[0]} spike-continuous panel, {panel.drive}, "
        f"{panel.luminance:g} cd/m², drawn by {run.result.renderer}"
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
        run.scenario.title, _subtitle(run, shown), _cards(run, shown), sections,
        files=[overview, *files, clip],
    )  # fmt: skip
