"""The report page of a link's run, with the section on the lock of the camera's clock."""

from __future__ import annotations

import html
import shlex
from pathlib import Path

import numpy as np

from cosim.config.amounts import amount, count, number
from cosim.report.drawn import Data, drawn
from cosim.report.parts import Card, plot, table
from cosim.run.machine import Page, Run
from cosim.run.result import Result
from link.evaluation.record import LinkEvaluation
from link.receiving.tags import least_module
from link.report.errors import cells_section, errors_section
from link.report.figures import (
    BLUE,
    INK,
    MARK,
    bits,
    delay_figure,
    figure_at,
    rates_figure,
    reach_figure,
)
from link.report.signal_figures import view_figure
from link.report.tables import NOT_KNOWN, effects_section, machine_section
from link.setup.distances import span_of
from link.setup.locking.loop import INTERVAL, ClockLock
from link.verdict import Cause

_ASKED = 0.1
"""Phase within which symbols of one tick keep their information, ticks."""


def link_page(link: LinkEvaluation, run: Run) -> Page:
    """Page of a run; writes its figures."""
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
        subtitle=f"{camera.chip.title}, {number(link.scenario.sensor.clock / 1e3)} kHz, a panel of "
        f"{link.mode.width} x {link.mode.height} pixels at {number(link.setting.air.distance)} m",
        simulated=_simulated(link, run),
        cards=_cards(link, run),
        sections=sections,
        good="How good the link is",
        quality="Goodput counts everything that is sent beside the file; a bit error rate of 0.01 "
        "means that one bit in a hundred is decided wrongly before codes mend it.",
        commands=[f"viform link receive {stream} --out again"],
        commands_do="<p>The first line decodes the recording again; the second reproduces the "
        "same bits.</p>",
        files=sorted(f"figures/{path.name}" for path in figures.glob("*.png")),
    )


def _simulated(link: LinkEvaluation, run: Run) -> str:
    """What was simulated, for a newcomer."""
    mode, camera = link.mode, link.setting.camera
    return (
        f"A file of {count(len(link.setup.payload.data))} bytes crosses "
        f"{number(link.setting.air.distance)} m of air as light. A panel of {mode.width} x "
        f"{mode.height} pixels switches squares of {mode.cell} x {mode.cell} pixels on and off, "
        f"{count(link.setting.panel.clock.hz)} times a second; a spike camera "
        f"({camera.chip.title}) films it for {amount(run.result.simulated_s, 's', 4)}, and a "
        "receiver turns the spikes back into bytes."
    )


def _view(link: LinkEvaluation, figures: Path) -> str:
    path = figures / "view.png"
    view_figure(link, path)
    detected = link.outline is not None
    outcome = "was detected by its four AprilTags" if detected else "was not detected"
    return (
        f"<h2>What the camera saw</h2><p>Spikes a cycle, mean over the run. The panel {outcome}. "
        f"Distance {number(link.setting.air.distance)} m, {number(link.setting.scale)} camera "
        "pixels to a "
        "panel pixel.</p>" + plot(path, "average image of the camera with the panel's outline")
    )


def _cards(link: LinkEvaluation, run: Run) -> list[Card]:
    lost, sent = _frames_of(run.result, "lost"), _frames_of(run.result, "sent")
    errors = NOT_KNOWN if link.errors.rate is None else number(link.errors.rate)
    return [
        ("first", "whole" if link.delivered else "not delivered",
         f"the file, {count(len(link.setup.payload.data))} bytes, {link.setup.payload.name}"),
        ("first", _rate(link.rates.goodput), "goodput: first light to last verified byte"),
        ("first", errors, "raw bit error rate"),
        ("", f"{lost} of {sent}", "frames lost"),
    ]  # fmt: skip


def _rate(value: float | None) -> str:
    return NOT_KNOWN if value is None else bits(value)


def _rates(link: LinkEvaluation, result: Result, figures: Path) -> str:
    path = figures / "rates.png"
    rows: list[tuple[str, float | None]] = [
        ("capacity of the panel's image", link.capacity), ("raw", link.rates.raw),
        ("information", link.information_bps[0]), ("coded", link.rates.coded),
        ("goodput", link.rates.goodput),
    ]  # fmt: skip
    drawn = rates_figure(rows, path)
    mode = link.mode
    rows_text = [
        ["cell", f"{mode.cell} x {mode.cell} panel pixels, "
         f"{number(mode.cell * link.setting.scale)} camera pixels to its side"],
        ["symbol", f"{mode.ticks} plane{'s' * (mode.ticks > 1)} of the panel"],
        ["line code", mode.line],
        ["code of the words", mode.word_code],
        *_decoding(link),
        ["data cells", f"{count(link.layout.cells)} of "
         f"{count(link.layout.shape[0] * link.layout.shape[1])}"],
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
        + plot(path, "rates, from the capacity of the light to the goodput of the file", drawn)
        + table(["mode", "value"], rows_text) + _choice(link)
    )  # fmt: skip


def _decoding(link: LinkEvaluation) -> list[list[str]]:
    """Row of what the words' decoder did, if there was a word."""
    r = link.received
    if not r.codewords:
        return []
    text = f"{count(r.codewords_wrong)} of {count(r.codewords)} lost, "
    text += f"{count(r.bytes_corrected)} bytes corrected"
    if r.mode is not None and r.mode.parity is None:
        text += f", {number(r.rounds / r.codewords)} rounds of decoding a word"
    rows = [["words", text]]
    runs = link.setup.sent.outbox.runs
    if runs:
        rows.append(["rates of the blocks", ", ".join(f"{rate:g}x{many}" for rate, many in runs)])
    return rows


def _frames_of(result: Result, name: str) -> str:
    value = result.metrics[f"frames_{name}"].value
    return NOT_KNOWN if value is None else count(value)


def _frames(result: Result) -> str:
    """Numbers of frames sent, and why there are more than the file's own."""
    sent, more, fill = (_frames_of(result, name) for name in ("sent", "repair", "fill"))
    return (
        f"{sent} sent; beyond the file's own, {more} for link.modem.overhead "
        f"and {fill} to fill the last group"
    )


def _known(value: float | None) -> str:
    return NOT_KNOWN if value is None else number(value)


def _choice(link: LinkEvaluation) -> str:
    if link.setup.choice is None:
        return ""
    tried = [row for row in link.setup.choice.rows if row.goodput is not None]
    rest = len(link.setup.choice.rows) - len(tried)
    rows = [
        [f"{row.mode.cell} x {row.mode.cell}", str(row.mode.ticks), row.mode.line,
         row.mode.word_code, _known(row.errors), _known(row.byte), _known(row.information),
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
    data = delay_figure(link, path)
    median = float(np.median(link.delays)) / 1e6
    rows = [
        [row.stage, *(amount(us * 1e-6, "s", 4) for us in (row.min_us, row.median_us, row.max_us))]
        for row in link.latency
    ]
    return (
        "<h2>From a byte to its arrival</h2><p>Time in the simulated machine. Encoder: a byte "
        "waits until its group of symbols is full, at the coded rate; a line-code word is as long "
        "as the group. Panel: the group is shown. Air: time of flight. Readout: until the camera's "
        "row and cycle are latched. Decoder: until the receiver has verified the group; computing "
        f"takes no time here.</p><p><code>latency_us</code>, {amount(median * 1e-6, 's', 4)}, is "
        "the median over groups of the time from a group's first light on the panel to the end of "
        "the camera cycle in which it was verified; it does not include the encoder.</p>"
        + plot(path, "latency by stage, end to end", data)
        + table(["stage", "minimum", "median", "maximum"], rows)
    )  # fmt: skip


def _reach(link: LinkEvaluation, figures: Path) -> str:
    near, far = span_of(link.setting, link.mode)
    limits = (
        f"A receiver can find this panel from {number(near)} m, where it fills the view, to "
        f"{number(far)} m, where its tags become too small: a module of theirs needs "
        f"{number(least_module(link.scene.blur), 2)} camera pixels, however large the cells."
        if near < far
        else "At no distance can a receiver find this panel: where it fits into the view, its tags "
        "are too small."
    )
    head = f"<h2>Rate against distance</h2><p>{limits} "
    if link.setup.mode_given:
        return (
            f"{head}The scenario gives the mode, so that no pilots predict the rate at other "
            "distances; leave a part of the mode <code>auto</code> for them.</p>"
        )
    rows = link.over_distance
    if not any(row.rate for row in rows):
        return f"{head}No mode is predicted to work at any of {count(len(rows))} distances.</p>"
    data = reach_figure(link, rows, figures / "reach.png")
    return (
        f"{head}At {count(len(rows))} distances the best mode was chosen as that of this run was, "
        "by pilots through the same air and camera, with this panel, lens and light; each point "
        "is the goodput that they predict for this file, with cell and ticks of the mode. The "
        "image of a resolved panel is equally bright at any distance, but smaller, so cells must "
        "grow. Between the points nothing was predicted: the rate falls in steps.</p>"
        + plot(figures / "reach.png", "predicted rate against distance, and this run", data)
    )  # fmt: skip


def _verdict(link: LinkEvaluation) -> str:
    good = link.verdict.cause is Cause.NONE
    head = "Received whole" if good else f"Verdict: {link.verdict.cause.value}"
    return f"<h2>{html.escape(head)}</h2><p>{html.escape(link.verdict.text)}</p>"


def phase_section(lock: ClockLock | None, figures: Path) -> str:
    """Section on a locked clock; writes its figure. Empty without a lock."""
    if lock is None:
        return ""
    path = figures / "phase.png"
    data = _figure(lock, path)
    return (
        "<h2>Phase of the clocks</h2><p>The board that makes the camera's ticks lengthens and "
        "shortens them by counts of its master clock, so that the panel's planes begin with them. "
        f"The loop locked within {count(lock.acquired)} ticks before the recording, from the phase "
        "that chance or the scenario gave. Over the recording the true phase, which the loop does "
        f"not know, was {number(lock.rms, 2)} ticks rms and at most {number(lock.most, 2)}. The "
        "loop's spikes are those of a model of a strip of the "
        "panel.</p>"
        + plot(path, "phase of the panel's planes over the run: true and measured", data)
    )


def _figure(lock: ClockLock, path: Path) -> Data:
    """Draws the true phase over the run, and what the loop measured with its standard errors."""
    with figure_at(path, 8.2, 2.8) as (figure, ax):
        ax.plot(np.arange(lock.phase.size), lock.phase, color=INK, linewidth=1.2, label="true")
        at = INTERVAL * np.arange(lock.measured.size)
        ax.errorbar(
            at, lock.measured, lock.error, fmt="o", markersize=4, color=BLUE, capsize=3,
            label="measured by the loop",
        )  # fmt: skip
        for limit in (-_ASKED, _ASKED):
            ax.axhline(limit, color=MARK, linewidth=1, linestyle="--")
        ax.set_xlim(0, lock.phase.size)
        ax.set_xlabel("tick of the recording")
        ax.set_ylabel("planes after the ticks, ticks")
        ax.legend(fontsize=8.5, frameon=False, ncols=2)
    return drawn(figure)
