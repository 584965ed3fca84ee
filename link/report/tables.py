"""Tables of a link's page: what was kept and left out, and the machine's numbers."""

from __future__ import annotations

import html
from collections.abc import Mapping
from typing import Any

from cosim.report.parts import table
from cosim.run.result import Result
from link.evaluation.record import LinkEvaluation
from link.trial.check import LinkCheck, Paired
from sensor.sections.provenance import fault_rows, optics_rows

__all__ = ["NOT_KNOWN", "error_text", "kept_section", "machine_section"]


NOT_KNOWN = "not known"
"""What the page says where the result says null."""


def _number(value: float | None) -> str:
    return NOT_KNOWN if value is None else f"{value:.2g}"


def _row(row: dict[str, Any], alone: Mapping[str, Paired | None]) -> list[str]:
    paired = alone.get(row["effect"])
    span = "" if paired is None else f" ({paired.low:.2g} to {paired.high:.2g})"
    return [
        str(row["effect"]), _number(row["bound"]), str(row["kind"]),
        _number(row["measured"]) + span,
    ]  # fmt: skip


def error_text(check: LinkCheck) -> str:
    """What the error and its interval mean, in words."""
    paired = check.paired
    if paired is None:
        return "The run's error was not measured."
    differ = paired.more + paired.fewer
    value, low, high = paired.counted
    limit = paired.differing_limit * 1e6
    counted = (
        f"{check.patches} patches of the sensor were simulated twice with the same random numbers "
        "in every pixel, as in this run and with every effect in the reference tier. Of "
        f"{paired.bits:,} bits {'none was' if not differ else f'{differ:,} were'} decided "
        f"differently ({paired.run:,} wrong as run, {paired.full:,} in full physics): at 99.9 % "
        f"fewer than {limit:.2g} in a million are. Counted in this way, the bit error rate "
        f"is off by {value:.2g} half-widths of the run's own 99.9 % interval, {paired.unit:.2g}, "
        f"at 99.9 % between {low:.2g} and {high:.2g}. The number of bits compared limits the "
        "upper end."
    )
    close = paired.near
    if close is None:
        return counted
    return (
        f"{counted} The error that is told is an estimate from {close.count:,} bits that are "
        f"nearly wrong, their soft value being for what was sent by less than {close.margin:.3g}: "
        f"{close.more:,} more and {close.fewer:,} fewer are so as run, a change of "
        f"{close.change * 100:.2g} %, at 99.9 % between {close.relative[0] * 100:.2g} % and "
        f"{close.relative[1] * 100:.2g} %. Where the bit error rate changes by the same share it "
        f"is off by {paired.value:.2g} half-widths, between {paired.low:.2g} and {paired.high:.2g}."
    )


def kept_section(link: LinkEvaluation, result: Result) -> str:
    """What was left out with its bound, and what was kept."""
    kept = ", ".join(result.kept) or "nothing"
    head = (
        "In the table, in such half-widths: the error foreseen of leaving an effect out, "
        "and the one measured without it alone, with its 99.9 % interval."
    )  # fmt: skip
    out = (
        table(
            ["left out", "changes by about", "", "measured"],
            [_row(r, link.check.alone) for r in result.left_out],
        )
        if result.left_out else "<p>Nothing was left out.</p>"
    )  # fmt: skip
    if not result.left_out:
        head = ""
    return (
        f"<h2>What was kept and what was left out</h2><p>{html.escape(error_text(link.check))}</p>"
        f"<p>{html.escape(head)}</p>{out}<p>Kept: {html.escape(kept)}.</p>"
    )


def machine_section(link: LinkEvaluation) -> str:
    """A table of the panel's, the lens's and the camera's numbers."""
    setting, section = link.setting, link.scenario.link
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
        ["light of a cell that is on", f"{link.scene.on:.3g} thresholds a tick", "computed"],
        ["light that is there in any case", f"{link.scene.background:.3g} thresholds a tick",
         "computed"],
        ["blur", f"{link.scene.blur:.3g} camera pixels, standard deviation", "computed"],
        ["pixels", f"{chip.width} x {chip.height}", provenance["width"]],
        ["latch clock", f"{camera.clock.hz / 1e3:g} kHz",
         provenance["clocks"] if camera.clock.hz in chip.clocks else "not one of this chip's"],
        ["charge threshold Q", f"{camera.threshold:g} e", "scenario"],
        ["reset rule", camera.reset, "scenario"],
        *optics_rows(camera),
        *fault_rows(link.scenario.sensor),
    ]  # fmt: skip
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers)
