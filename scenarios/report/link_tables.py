"""Tables of a link's page: what was kept and left out, and the machine's numbers."""

from __future__ import annotations

import html
from typing import Any

from scenarios.link_run.finished import LinkRun
from scenarios.report.machine import faults, optics
from scenarios.report.parts import table

__all__ = ["kept_section", "machine_section"]


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2g}"


def _row(row: dict[str, Any]) -> list[str]:
    return [
        str(row["effect"]), _number(row["bound"]), str(row["kind"]), _number(row["measured"])
    ]  # fmt: skip


def kept_section(run: LinkRun) -> str:
    """What was left out with its bound, and what was kept."""
    result = run.result
    kept = ", ".join(result.kept) or "nothing"
    said = (
        "In half-widths of the 99.9 % interval of the run's bit error rate: the error that leaving "
        "an effect out can make, and the error that was measured on patches of the panel."
    )  # fmt: skip
    out = (
        table(["left out", "changes at most", "", "measured"], [_row(r) for r in result.left_out])
        if result.left_out else "<p>Nothing was left out.</p>"
    )  # fmt: skip
    error = result.error
    told = "The run's error was not measured."
    if error.value is not None:
        high = "" if error.ci is None else f" (99.9 %: {error.ci[0]:.2g} to {error.ci[1]:.2g})"
        told = f"Error against full physics: {error.value:.2g}{high}; {error.kind}."
    return (
        f"<h2>What was kept and what was left out</h2><p>{html.escape(said)} "
        f"{html.escape(told)}</p>{out}<p>Kept: {html.escape(kept)}.</p>"
    )


def machine_section(run: LinkRun) -> str:
    """A table of the panel's, the lens's and the camera's numbers."""
    setting, section = run.setting, run.scenario.link
    camera, chip, panel = setting.camera, setting.camera.chip, setting.panel
    provenance = chip.provenance()
    numbers = [
        ["panel", f"{panel.shape[1]} x {panel.shape[0]} pixels of {section.panel.pitch:g} um, "
         f"{panel.luminance:g} cd/m2", "scenario"],
        ["its clock", f"{panel.clock.hz:.9g} Hz, {section.panel.clock_offset:g} ppm off",
         "scenario"],
        ["its rows", f"driven over {panel.row_scan:.4g} of a tick",
         "in step with the camera" if section.panel.row_scan is None else "scenario"],
        ["its planes are late by", f"{setting.phase:.4g} ticks",
         "by chance" if section.panel.phase is None else "scenario"],
        ["lens", f"{setting.optics.focal_length * 1e3:g} mm, f/{setting.optics.f_number:.3g}, "
         f"T {setting.optics.transmission:g}",
         f"f-number chosen for {section.aim.on_level:g} thresholds a tick"
         if setting.chosen_f_number else "scenario"],
        ["light of a cell that is on", f"{run.scene.on:.3g} thresholds a tick", "computed"],
        ["light that is there in any case", f"{run.scene.background:.3g} thresholds a tick",
         "computed"],
        ["blur", f"{run.scene.blur:.3g} camera pixels, standard deviation", "computed"],
        ["pixels", f"{chip.width} x {chip.height}", provenance["width"]],
        ["latch clock", f"{camera.clock.hz / 1e3:g} kHz",
         provenance["clocks"] if camera.clock.hz in chip.clocks else "not one of this chip's"],
        ["charge threshold Q", f"{camera.threshold:g} e", "scenario"],
        ["reset rule", camera.reset, "scenario"],
        *optics(camera),
        *faults(run.scenario.sensor),
    ]  # fmt: skip
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers)
