"""Tables of a link's page: simulated and omitted effects, and the machine's parameters."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

from cosim.config.amounts import count, number
from cosim.report.parts import table
from cosim.run.result import Result, measured_text
from link.evaluation.record import LinkEvaluation
from link.plan.check import LinkCheck
from sensor.sections.provenance import fault_rows, optics_rows

NOT_KNOWN = "not known"
"""Text for a null of the result."""


def _number(value: float | None) -> str:
    return NOT_KNOWN if value is None else number(value, 2)


def _row(row: dict[str, Any]) -> list[str]:
    return [str(row["effect"]), _number(row["bound"]), str(row["kind"]), measured_text(row)]


def error_text(check: LinkCheck) -> str:
    """Meaning of the error and its interval, in words."""
    paired = check.paired
    if paired is None:
        return "The run's error was not measured."
    differ = paired.more + paired.fewer
    counts, error = paired.counted, paired.error
    limit = paired.differing_limit * 1e6
    counted = (
        f"{check.patches} patches of the sensor were simulated twice with the same random numbers "
        "in every pixel, as in this run and with every effect in the reference tier. Of "
        f"{count(paired.bits)} bits {'none was' if not differ else f'{count(differ)} were'} "
        f"decided differently ({count(paired.run)} wrong as run, {count(paired.full)} in full "
        f"physics): at 99.9 % fewer than {number(limit, 2)} in a million are. Counted in this way, "
        f"the bit error rate is off by {number(counts.value, 2)} half-widths of the run's own "
        f"99.9 % interval, {number(paired.unit, 2)}, at 99.9 % between {number(counts.low, 2)} and "
        f"{number(counts.high, 2)}. The number of bits compared limits the upper end."
    )
    close = paired.near
    if close is None:
        return counted
    return (
        f"{counted} The reported error is an estimate from {count(close.count)} bits that are "
        f"nearly wrong: their soft value favours the sent bit by less than {number(close.margin)}. "
        f"As run, {count(close.more)} more and {count(close.fewer)} fewer are nearly wrong, a "
        f"change of {number(close.change * 100, 2)} %, at 99.9 % between "
        f"{number(close.relative[0] * 100, 2)} % and {number(close.relative[1] * 100, 2)} %. If "
        f"the bit error rate changes by the same share, it is off by {number(error.value, 2)} "
        f"half-widths, between {number(error.low, 2)} and {number(error.high, 2)}."
    )


def left_out_table(rows: Sequence[dict[str, Any]]) -> str:
    """Table of the effects left out. rows: of `left_out_documents`."""
    if not rows:
        return "<p>Nothing was left out.</p>"
    return table(["left out", "bound", "", "measured"], [_row(row) for row in rows])


def effects_section(link: LinkEvaluation, result: Result) -> str:
    """Section on effects: those left out with their bounds, and those simulated."""
    simulated = ", ".join(result.kept) or "none"
    head = (
        "The table lists, in such half-widths, the bound of leaving an effect out, and the "
        "measured error without this effect alone, with its 99.9 % interval."
    )  # fmt: skip
    out = left_out_table(result.left_out)
    if not result.left_out:
        head = ""
    return (
        f"<h2>What was kept and what was left out</h2><p>{html.escape(error_text(link.check))}</p>"
        f"<p>{html.escape(head)}</p>{out}<p>Kept: {html.escape(simulated)}.</p>"
    )


def _phase_row(link: LinkEvaluation) -> list[str]:
    lock = link.setup.lock
    if lock is not None:
        locked = f"locked to {number(lock.rms, 2)} ticks rms"
        return ["delay of its planes", locked, "the camera's loop"]
    chance = link.scenario.link.panel.phase is None
    late = f"{number(link.setting.phase, 4)} ticks"
    return ["delay of its planes", late, "random" if chance else "scenario"]


def machine_section(link: LinkEvaluation) -> str:
    """A table of the parameters of panel, lens and camera."""
    setting, section = link.setting, link.scenario.link
    camera, chip, panel = setting.camera, setting.camera.chip, setting.panel
    provenance, latched = chip.provenance(), link.scenario.sensor.clock
    numbers = [
        ["panel", f"{panel.shape[1]} x {panel.shape[0]} pixels of "
         f"{number(section.panel.pitch)} µm, {number(panel.luminance)} cd/m²", "scenario"],
        ["clock of the panel", f"{number(panel.clock.hz, 9)} Hz, "
         f"{number(section.panel.clock_offset)} ppm off",
         "scenario"],
        ["rows of the panel", f"driven over {number(panel.row_scan, 4)} of a tick",
         "in step with the camera" if section.panel.row_scan is None else "scenario"],
        _phase_row(link),
        ["lens", f"{number(setting.optics.focal_length * 1e3)} mm, "
         f"f/{number(setting.optics.f_number)}, T {number(setting.optics.transmission)}",
         f"f-number chosen for {number(section.aim.on_level)} thresholds a tick"
         if setting.chosen_f_number else "scenario"],
        ["light of an ON cell", f"{number(link.scene.on)} thresholds a tick", "computed"],
        ["background light", f"{number(link.scene.background)} thresholds a tick", "computed"],
        ["blur", f"{number(link.scene.blur)} camera pixels, standard deviation", "computed"],
        ["pixels", f"{chip.width} x {chip.height}", chip.size_origin],
        ["latch clock", f"{number(latched / 1e3)} kHz",
         provenance["clocks"] if latched in chip.clocks else "not one of this chip's"],
        ["charge threshold Q", f"{number(camera.threshold)} e", "scenario"],
        ["reset rule", camera.reset, "scenario"],
        *optics_rows(camera),
        *fault_rows(link.scenario.sensor),
    ]  # fmt: skip
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers)
