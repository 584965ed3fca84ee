"""Tables of a link's page: simulated and omitted effects, and the machine's parameters."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

from cosim.report.parts import table
from cosim.run.result import Result
from link.evaluation.record import LinkEvaluation
from link.trial.check import LinkCheck, Paired
from sensor.sections.provenance import fault_rows, optics_rows

__all__ = ["NOT_KNOWN", "effects_section", "error_text", "left_out_table", "machine_section"]


NOT_KNOWN = "not known"
"""Text for a null of the result."""


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
    """Returns the meaning of the error and its interval, in words."""
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
        f"{counted} The reported error is an estimate from {close.count:,} bits that are nearly "
        f"wrong: their soft value favours the sent bit by less than {close.margin:.3g}. As run, "
        f"{close.more:,} more and {close.fewer:,} fewer are nearly wrong, a change of "
        f"{close.change * 100:.2g} %, at 99.9 % between {close.relative[0] * 100:.2g} % and "
        f"{close.relative[1] * 100:.2g} %. If the bit error rate changes by the same share, it "
        f"is off by {paired.value:.2g} half-widths, between {paired.low:.2g} and {paired.high:.2g}."
    )


def left_out_table(
    rows: Sequence[dict[str, Any]], alone: Mapping[str, Paired | None]
) -> str:  # fmt: skip
    """Returns the table of the effects left out. alone: measured error without each of them."""
    if not rows:
        return "<p>Nothing was left out.</p>"
    return table(["left out", "bound", "", "measured"], [_row(r, alone) for r in rows])


def effects_section(link: LinkEvaluation, result: Result) -> str:
    """Returns the section on effects: those left out with their bounds, and those simulated."""
    simulated = ", ".join(result.kept) or "none"
    head = (
        "The table lists, in such half-widths, the bound of leaving an effect out, and the "
        "measured error without this effect alone, with its 99.9 % interval."
    )  # fmt: skip
    out = left_out_table(result.left_out, link.check.alone)
    if not result.left_out:
        head = ""
    return (
        f"<h2>What was kept and what was left out</h2><p>{html.escape(error_text(link.check))}</p>"
        f"<p>{html.escape(head)}</p>{out}<p>Kept: {html.escape(simulated)}.</p>"
    )


def _phase_row(link: LinkEvaluation) -> list[str]:
    lock = link.setup.lock
    if lock is not None:
        return ["delay of its planes", f"locked to {lock.rms:.2g} ticks rms", "the camera's loop"]
    chance = link.scenario.link.panel.phase is None
    late = f"{link.setting.phase:.4g} ticks"
    return ["delay of its planes", late, "random" if chance else "scenario"]


def machine_section(link: LinkEvaluation) -> str:
    """Returns a table of the parameters of panel, lens and camera."""
    setting, section = link.setting, link.scenario.link
    camera, chip, panel = setting.camera, setting.camera.chip, setting.panel
    provenance, latched = chip.provenance(), link.scenario.sensor.clock
    numbers = [
        ["panel", f"{panel.shape[1]} x {panel.shape[0]} pixels of {section.panel.pitch:g} um, "
         f"{panel.luminance:g} cd/m2", "scenario"],
        ["clock of the panel", f"{panel.clock.hz:.9g} Hz, {section.panel.clock_offset:g} ppm off",
         "scenario"],
        ["rows of the panel", f"driven over {panel.row_scan:.4g} of a tick",
         "in step with the camera" if section.panel.row_scan is None else "scenario"],
        _phase_row(link),
        ["lens", f"{setting.optics.focal_length * 1e3:g} mm, f/{setting.optics.f_number:.3g}, "
         f"T {setting.optics.transmission:g}",
         f"f-number chosen for {section.aim.on_level:g} thresholds a tick"
         if setting.chosen_f_number else "scenario"],
        ["light of an ON cell", f"{link.scene.on:.3g} thresholds a tick", "computed"],
        ["background light", f"{link.scene.background:.3g} thresholds a tick", "computed"],
        ["blur", f"{link.scene.blur:.3g} camera pixels, standard deviation", "computed"],
        ["pixels", f"{chip.width} x {chip.height}", chip.size_origin],
        ["latch clock", f"{latched / 1e3:g} kHz",
         provenance["clocks"] if latched in chip.clocks else "not one of this chip's"],
        ["charge threshold Q", f"{camera.threshold:g} e", "scenario"],
        ["reset rule", camera.reset, "scenario"],
        *optics_rows(camera),
        *fault_rows(link.scenario.sensor),
    ]  # fmt: skip
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers)
