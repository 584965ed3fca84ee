"""The report page of a link's run."""

from __future__ import annotations

import html
import shlex
import time
from pathlib import Path

import numpy as np

from cosim.report.parts import cards, plot, table
from cosim.run.machine import Page, Run
from cosim.run.result import Result
from link.evaluation.record import LinkEvaluation
from link.receiving.tags import least_module
from link.report.cells import cells_section
from link.report.errors import errors_section
from link.report.figures import bits, delay_figure, rates_figure, reach_figure
from link.report.phase import phase_section
from link.report.signal_figures import view_figure
from link.report.tables import NOT_KNOWN, effects_section, machine_section
from link.verdict import Cause

__all__ = ["link_page"]


def _rate(value: float | None) -> str:
    return NOT_KNOWN if value is None else bits(value)


def _count(value: float | None) -> str:
    return NOT_KNOWN if value is None else f"{value:.3g}"


def _frames_of(result: Result, name: str) -> str:
    value = result.metrics[f"frames_{name}"].value
    return NOT_KNOWN if value is None else f"{value:,.0f}"


def _cards(link: LinkEvaluation, run: Run) -> str:
    error, spent = run.result.error, time.perf_counter() - run.began
    paired = link.check.paired
    text = (
        "error against full physics: not measured" if paired is None
        else f"error against full physics, at most {paired.high:.2g} (99.9 %): {paired.kind}"
    )  # fmt: skip
    lost, sent = _frames_of(run.result, "lost"), _frames_of(run.result, "sent")
    return cards([
        ("first", "whole" if link.delivered else "not delivered",
         f"{len(link.setup.payload.data):,} bytes, {link.setup.payload.name}"),
        ("first", _rate(link.rates.goodput), "goodput: first light to last verified byte"),
        ("first", _count(link.errors.rate), "raw bit error rate"),
        ("", f"{lost} of {sent}", "frames lost"),
        ("", _count(error.value), text),
        ("", f"{spent:.1f} s", f"run time, for {run.result.simulated_s * 1e3:.4g} ms"),
        ("", str(len(run.result.left_out)), "effects left out"),
    ])  # fmt: skip


def _view(link: LinkEvaluation, figures: Path) -> str:
    path = figures / "view.png"
    view_figure(link, path)
    detected = link.outline is not None
    outcome = "was detected by its four AprilTags" if detected else "was not detected"
    return (
        f"<h2>What the camera saw</h2><p>Spikes a cycle, mean over the run. The panel {outcome}. "
        f"Distance {link.setting.air.distance:g} m, {link.setting.scale:.3g} camera pixels to a "
        "panel pixel.</p>" + plot(path, "average image with the panel's outline")
    )


def _rates(link: LinkEvaluation, result: Result, figures: Path) -> str:
    path = figures / "rates.png"
    rows: list[tuple[str, float | None]] = [
        ("capacity of the panel's image", link.capacity), ("raw", link.rates.raw),
        ("information", link.information_bps[0]), ("coded", link.rates.coded),
        ("goodput", link.rates.goodput),
    ]  # fmt: skip
    rates_figure(rows, path)
    mode = link.mode
    rows_text = [
        ["cell", f"{mode.cell} x {mode.cell} panel pixels, "
         f"{mode.cell * link.setting.scale:.3g} camera pixels to its side"],
        ["symbol", f"{mode.ticks} plane{'s' * (mode.ticks > 1)} of the panel"],
        ["line code", mode.line],
        ["code of the words", mode.word_code],
        *_decoding(link),
        ["data cells", f"{link.layout.cells:,} of {link.layout.shape[0] * link.layout.shape[1]:,}"],
        ["frames", _frames(result)],
    ]  # fmt: skip
    return (
        "<h2>Rates</h2><p>Capacity: of all camera pixels on the panel's image, one bit a tick, or "
        "the capacity of their light if that is less; <code>viform link capacity</code> lists the "
        "losses. Raw: one bit of every data cell in every symbol. Information: what a code that "
        "decides by the receiver's soft values can carry of it at most (generalised mutual "
        "information of the bits that were compared). Coded: the rate after line "
        "code and the code of the words. "
        "Goodput: the file's bits from first light to its last verified "
        "byte, training, framing and repair frames included.</p>"
        + plot(path, "rates") + table(["mode", "value"], rows_text) + _choice(link)
    )  # fmt: skip


def _decoding(link: LinkEvaluation) -> list[list[str]]:
    """Returns the row of what the words' decoder did, if there was a word."""
    r = link.received
    if not r.codewords:
        return []
    text = f"{r.codewords_wrong:,} of {r.codewords:,} lost, {r.bytes_corrected:,} bytes corrected"
    if r.mode is not None and r.mode.parity is None:
        text += f", {r.rounds / r.codewords:.3g} rounds of decoding a word"
    return [["words", text]]


def _frames(result: Result) -> str:
    """Returns the numbers of frames sent, and why there are more than the file's own."""
    sent, more, fill = (_frames_of(result, name) for name in ("sent", "repair", "fill"))
    return (
        f"{sent} sent; beyond the file's own, {more} for link.modem.overhead "
        f"and {fill} to fill the last group"
    )


def _choice(link: LinkEvaluation) -> str:
    if link.setup.choice is None:
        return ""
    tried = [row for row in link.setup.choice.rows if row.goodput is not None]
    rest = len(link.setup.choice.rows) - len(tried)
    rows = [
        [f"{row.mode.cell} x {row.mode.cell}", str(row.mode.ticks), row.mode.line,
         row.mode.word_code, _count(row.errors), _count(row.byte), _count(row.information),
         bits(row.goodput) if row.goodput else "none"]
        for row in sorted(tried, key=lambda row: -(row.goodput or 0.0))[:12]
    ]  # fmt: skip
    head = [
        "cell",
        "ticks",
        "line code",
        "code of the words",
        "raw errors",
        "bytes",
        "information",
        "predicted goodput",
    ]
    return (
        "<h3>How the mode was chosen</h3><p>A strip of such a panel was filmed through the same "
        "air with pilots. Reed-Solomon was rated by the wrong bytes, 1.5 times their upper limit; "
        "codes with soft decisions by the information of a bit, its lower limit taken to lack "
        "1.1 times what it lacks; the fountain code by the words lost. "
        f"{rest} modes were not tried, because they are slower than one that "
        "works or require more than one that fails. The best:</p>" + table(head, rows)
    )  # fmt: skip


def _delay(link: LinkEvaluation, figures: Path) -> str:
    path = figures / "latency.png"
    if not link.delays.size:
        return "<h2>Latency</h2><p>No group was verified.</p>"
    delay_figure(link, path)
    median = float(np.median(link.delays)) / 1e6
    rows = [
        [row.stage, f"{row.min_us:.6g}", f"{row.median_us:.6g}", f"{row.max_us:.6g}"]
        for row in link.latency
    ]
    return (
        "<h2>From a byte to its arrival</h2><p>Time in the simulated machine. Encoder: a byte "
        "waits until its group of symbols is full, at the coded rate; a line-code word is as long "
        "as the group. Panel: the group is shown. Air: time of flight. Readout: until the camera's "
        "row and cycle are latched. Decoder: until the receiver has verified the group; computing "
        f"takes no time here.</p><p><code>latency_us</code>, {median:.6g} us, is the median over "
        "groups of the time from a group's first light on the panel to the end of the camera cycle "
        "in which it was verified; it does not include the encoder.</p>"
        + plot(path, "latency by stage")
        + table(["stage", "minimum, us", "median, us", "maximum, us"], rows)
    )  # fmt: skip


def _tags(link: LinkEvaluation) -> str:
    """Returns the distance from which on the tags are too small."""
    far = [row.distance for row in link.reach if not row.tags]
    if not far:
        return ""
    return (
        f" From {min(far):.3g} m on: tags too small. A module needs "
        f"{least_module(link.scene.blur):.2g} camera pixels, and a panel without detected tags "
        "is not read, however large its cells."
    )


def _reach(link: LinkEvaluation, figures: Path) -> str:
    path = figures / "reach.png"
    tags = _tags(link)
    if not any(row.rate for row in link.reach):
        return f"<h2>Rate against distance</h2><p>No distance is predicted to work.{tags}</p>"
    reach_figure(link, path)
    return (
        "<h2>Rate against distance</h2><p>A prediction from geometry and closed forms, not a "
        "measurement, for this panel, lens, light and camera and the modes that a run tries "
        "itself. The image of a resolved panel is equally bright at any distance, but smaller, so "
        "cells must grow. Closer than the start of the line, the panel does not fit "
        f"into the view. Only the dots come from this run.{tags}</p>"
        + plot(path, "rate against distance")
    )  # fmt: skip


def _verdict(link: LinkEvaluation) -> str:
    good = link.verdict.cause is Cause.NONE
    head = "Received whole" if good else f"Verdict: {link.verdict.cause.value}"
    return f"<h2>{html.escape(head)}</h2><p>{html.escape(link.verdict.text)}</p>"


def link_page(link: LinkEvaluation, run: Run) -> Page:
    """Returns the page of a run; writes its figures."""
    figures, camera = run.folder / "figures", link.setting.camera
    sections = [
        _verdict(link), _rates(link, run.result, figures), _delay(link, figures),
        errors_section(link, figures), cells_section(link, figures), _view(link, figures),
        phase_section(link.setup.lock, figures), _reach(link, figures),
        effects_section(link, run.result), machine_section(link),
    ]  # fmt: skip
    stream = shlex.quote(str(run.folder / "stream.zarr"))
    return Page(
        title=link.scenario.title,
        subtitle=f"{camera.chip.title}, {link.scenario.sensor.clock / 1e3:g} kHz, a panel of "
        f"{link.mode.width} x {link.mode.height} pixels at {link.setting.air.distance:g} m",
        cards=_cards(link, run),
        sections=sections,
        commands=[f"viform link receive {stream} --out again"],
        commands_do="<p>The first line decodes the recording again; the second reproduces the "
        "same bits.</p>",
        files=sorted(f"figures/{path.name}" for path in figures.glob("*.png")),
    )
