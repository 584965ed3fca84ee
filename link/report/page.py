"""The page of a run of a link."""

from __future__ import annotations

import html
import shlex
import time

import numpy as np
import numpy.typing as npt

from cosim.config.toml import to_toml
from cosim.report.parts import cards, opening, plot, run_time, table, write_page
from link.evaluation.eye import RARE
from link.evaluation.finished import LinkRun
from link.receiving.tags import least_module
from link.report.errors import of_end, of_theory
from link.report.figures import (
    bits,
    cells_figure,
    delay_figure,
    errors_figure,
    eye_figure,
    rates_figure,
    reach_figure,
    soft_figure,
    view_figure,
)
from link.report.tables import NOT_KNOWN, kept_section, machine_section
from link.verdict import Cause

__all__ = ["write_link_report"]


def _rate(value: float | None) -> str:
    return NOT_KNOWN if value is None else bits(value)


def _count(value: float | None) -> str:
    return NOT_KNOWN if value is None else f"{value:.3g}"


def _frames_of(run: LinkRun, name: str) -> str:
    value = run.result.metrics[f"frames_{name}"].value
    return NOT_KNOWN if value is None else f"{value:,.0f}"


def _cards(run: LinkRun) -> str:
    error, spent = run.result.error, time.perf_counter() - run.began
    paired = run.check.paired
    told = (
        "error against full physics: not measured" if paired is None
        else f"error against full physics, at most {paired.high:.2g} (99.9 %): {paired.kind}"
    )  # fmt: skip
    lost, sent = _frames_of(run, "lost"), _frames_of(run, "sent")
    return cards([
        ("first", "whole" if run.delivered else "not delivered",
         f"{len(run.payload.data):,} bytes, {run.payload.name}"),
        ("first", _rate(run.rates.goodput), "goodput: first light to last verified byte"),
        ("first", _count(run.errors.rate), "raw bit error rate"),
        ("", f"{lost} of {sent}", "frames lost"),
        ("", _count(error.value), told),
        ("", f"{spent:.1f} s", f"run time, for {run.result.simulated_s * 1e3:.4g} ms"),
        ("", str(len(run.result.left_out)), "effects left out"),
    ])  # fmt: skip


def _view(run: LinkRun) -> str:
    path = run.folder / "figures" / "view.png"
    view_figure(run, path)
    found = "was found by its four AprilTags" if run.outline is not None else "was not found"
    return (
        f"<h2>What the camera saw</h2><p>Spikes a cycle, mean over the run. The panel {found}. "
        f"Distance {run.setting.air.distance:g} m, {run.setting.scale:.3g} camera pixels to a "
        "panel pixel.</p>" + plot(path, "average image with the panel's outline")
    )


def _rates(run: LinkRun) -> str:
    path = run.folder / "figures" / "rates.png"
    rows: list[tuple[str, float | None]] = [
        ("capacity of the pixels that see it", run.capacity), ("raw", run.rates.raw),
        ("coded", run.rates.coded), ("goodput", run.rates.goodput),
    ]  # fmt: skip
    rates_figure(rows, path)
    mode = run.mode
    rows_text = [
        ["cell", f"{mode.cell} x {mode.cell} panel pixels, "
         f"{mode.cell * run.setting.scale:.3g} camera pixels to its side"],
        ["symbol", f"{mode.ticks} plane{'s' * (mode.ticks > 1)} of the panel"],
        ["line code", mode.line],
        ["Reed-Solomon", f"(255, {255 - mode.parity})"],
        ["data cells", f"{run.layout.cells:,} of {run.layout.shape[0] * run.layout.shape[1]:,}"],
        ["frames", _frames(run)],
    ]  # fmt: skip
    return (
        "<h2>Rates</h2><p>Capacity: of all camera pixels that see the panel, a bit a tick, or what "
        "their light could carry where that is less; <code>viform link capacity</code> tells what "
        "costs how much of it. Raw: a bit of every data cell in every symbol. Coded: what line "
        "code and Reed-Solomon leave of it. "
        "Goodput: the file's bits from first light to its last verified "
        "byte, training, framing and repair frames counted.</p>"
        + plot(path, "rates") + table(["mode", "value"], rows_text) + _choice(run)
    )  # fmt: skip


def _frames(run: LinkRun) -> str:
    """What was sent beyond the file's own frames, and why."""
    sent, more, fill = (_frames_of(run, name) for name in ("sent", "repair", "fill"))
    return (
        f"{sent} sent; beyond the file's own, {more} that link.modem.overhead asks for "
        f"and {fill} that only fill the last group"
    )


def _choice(run: LinkRun) -> str:
    if run.choice is None:
        return ""
    tried = [row for row in run.choice.rows if row.goodput is not None]
    rest = len(run.choice.rows) - len(tried)
    rows = [
        [f"{row.mode.cell} x {row.mode.cell}", str(row.mode.ticks), row.mode.line,
         f"(255, {255 - row.mode.parity})", _count(row.errors), _count(row.byte),
         bits(row.goodput) if row.goodput else "none"]
        for row in sorted(tried, key=lambda row: -row.goodput)[:12]
    ]  # fmt: skip
    head = ["cell", "ticks", "line code", "Reed-Solomon", "raw errors", "bytes", "goodput foreseen"]
    return (
        "<h3>How the mode was chosen</h3><p>A strip of such a panel was filmed through the same "
        "air with pilots; Reed-Solomon and the fountain were weighed by the wrong bytes, at their "
        f"upper limit and half as many again. {rest} modes were not tried, being slower than what "
        "works or asking for more than what does not. The best:</p>" + table(head, rows)
    )  # fmt: skip


def _errors(run: LinkRun) -> str:
    path, theory = run.folder / "figures" / "errors.png", run.theory
    errors_figure(run, path)
    span = ""
    if theory.interval is not None:
        span = f", 99.9 % interval {theory.interval[0]:.2g} to {theory.interval[1]:.2g}"
    return (
        f"<h2>Errors</h2><p>{run.errors.wrong:,} of {run.errors.bits:,} bits on data cells were "
        f"decided wrong before any code{span}. The soft values' own promise is the mean of "
        "1/(1 + exp |L|) over all of them: what they would be wrong by if they were the truth. "
        "They take a cell's pixels and ticks as independent of each other, though the cells beside "
        "light them together; the receiver shrinks them by the factor that the training asks for. "
        f"{of_theory(run.theory)}{of_end(run.errors)}</p>"
        + plot(path, "bit error rates") + _eye(run) + _soft(run)
    )  # fmt: skip


def _eye(run: LinkRun) -> str:
    eye = run.eye
    if eye is None:
        return ""
    path = run.folder / "figures" / "eye.png"
    eye_figure(eye, path)
    told = (
        f"With {RARE:.0%} of each bit left aside it is {eye.height:.3f} high and {eye.width:.3g} "
        f"ticks wide; the level half-way is {eye.level:.3f}."
        if eye.height > 0
        else f"It is closed: with {RARE:.0%} of each bit left aside, on and off overlap by "
        f"{abs(eye.height):.3f}."
    )
    at = " to ".join(f"{tick:+.2f}" for tick in eye.sampled)
    return (
        f"<h3>The eye</h3><p>{eye.traces:,} symbols of data cells, from the recording: spikes of "
        "the pixels that see a cell, each weighted by the share of its light that is the cell's, "
        f"mean of a window of {run.mode.ticks} ticks as it slides past the symbol, 1 where all "
        "fire. The camera sees whole ticks; where a symbol begins between them differs by row and, "
        "with the clocks' offset, by symbol; in between traces are drawn straight. "
        f"The window nearest to a symbol lies {at} ticks from its middle. {told} Detectors weigh "
        "each tick by what it tells, and by what came before, and err less than this sum.</p>"
        + plot(path, "eye diagram")
    )


def _soft(run: LinkRun) -> str:
    if run.soft is None or not run.soft.soft.size:
        return ""
    path = run.folder / "figures" / "soft.png"
    soft_figure(run.soft, path)
    return (
        f"<h3>Soft values</h3><p>What the detector made of {run.soft.soft.size:,} symbols, by what "
        "was sent: how sure it was, and how seldom in vain. What lies on the wrong side of 0 was "
        "decided wrong; a value is cut at what a detector gives at most, so the outermost bins may "
        "stand high.</p>" + plot(path, "histogram of soft values")
    )


def _why(run: LinkRun) -> list[str]:
    """Where cells fail, told from the map itself."""
    wrong, told = run.errors.by_cell, []
    carries = wrong >= 0
    if not run.errors.symbols or not carries.any():
        return ["No symbol was compared."]
    share = np.where(carries, wrong, 0) / run.errors.symbols
    mean = share[carries].mean()
    told.append(f"A cell is wrong in {mean:.2g} of its symbols on average, the worst in "
                f"{share.max():.2g}.")  # fmt: skip
    beside = np.zeros_like(carries)
    beside[:, 1:] |= ~carries[:, :-1]
    beside[:, :-1] |= ~carries[:, 1:]
    beside[1:] |= ~carries[:-1]
    beside[:-1] |= ~carries[1:]
    edge = np.zeros_like(carries)
    edge[[0, -1]] = True
    edge[:, [0, -1]] = True
    told += _beside_grid(run, carries)
    for name, mask in (
        ("at the panel's edge, where half of the neighbourhood is dark", edge),
        ("beside tags and pilots", beside & ~edge),
    ):
        mine = mask & carries
        if mine.any():
            told.append(f"Cells {name}: {share[mine].mean():.2g}.")
    rows, columns = carries.shape
    quarter = [
        share[rows * i // 3 : rows * (i + 1) // 3, columns * j // 3 : columns * (j + 1) // 3]
        for i in range(3) for j in range(3)
    ]  # fmt: skip
    ninth = [float(part.mean()) for part in quarter]
    told.append(f"Of nine parts of the panel the best has {min(ninth):.2g}, the worst "
                f"{max(ninth):.2g}: what differs between them is the grids' beat, the rows' timing "
                "and turbulence.")  # fmt: skip
    return told


def _fifths(order: npt.NDArray[np.intp], wrong: npt.NDArray[np.int64]) -> list[float]:
    """Share of all errors in each fifth of the cells, as they are ordered."""
    parts = np.array_split(wrong[order], 5)
    return [float(part.sum() / wrong.sum()) for part in parts]


def _grids(run: LinkRun, carries: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64] | None:
    """How far the edges of each data cell lie from the nearest border of camera pixels, camera
    pixels, the worse of both axes; None where the panel was not found."""
    found = run.received.registration
    if found is None or run.received.mode != run.mode:
        return None
    row, column = np.nonzero(carries)
    side = run.mode.cell
    off = []
    for right in (0, 1):
        x, y = found.camera((column + right) * side - 0.5, (row + right) * side - 0.5)
        off += [np.abs(z + 0.5 - np.round(z + 0.5)) for z in (x, y)]
    return np.asarray(np.max(off, axis=0), np.float64)


def _beside_grid(run: LinkRun, carries: npt.NDArray[np.bool_]) -> list[str]:
    """Where errors lie against how sure cells are, and against the grid of camera pixels."""
    wrong = run.errors.by_cell[carries]
    if not wrong.sum():
        return []
    sure = np.asarray(run.received.cell_quality, np.float64)[carries]
    by_sure = _fifths(np.argsort(sure, kind="stable"), wrong)
    told = [
        f"The fifth of cells with the lowest mean |soft value| has {by_sure[0]:.0%} of the errors, "
        f"the fifth with the highest {by_sure[4]:.0%}"
        + (
            ": it is not where cells are least sure on average that decisions fail."
            if by_sure[0] < by_sure[4] else "."
        )
    ]  # fmt: skip
    off = _grids(run, carries)
    if off is not None:
        by_grid = _fifths(np.argsort(off, kind="stable"), wrong)
        near = by_grid[0] > by_grid[4]
        told.append(
            "The fifth whose edges lie nearest to borders of camera pixels has "
            f"{by_grid[0]:.0%} of them, the fifth farthest from them {by_grid[4]:.0%}: "
            + (
                "a cell on whole pixels of its own has the fewest that look at it."
                if near
                else "pixels that see two cells at once tell them apart less well."
            )
        )
    return told


def _cells(run: LinkRun) -> str:
    path = run.folder / "figures" / "cells.png"
    quality = getattr(run.received, "cell_quality", None)
    if quality is None:
        return "<h2>Cells</h2><p>No cell was read.</p>"
    cells_figure(np.asarray(quality, np.float64), run.errors.by_cell, run.errors.symbols, path)
    told = "".join(f"<li>{html.escape(each)}</li>" for each in _why(run))
    return (
        "<h2>Which cells fail</h2><p>Pale: tags and pilots. Stripes or spots are the beat "
        "of the panel's cells and the camera's pixels: where an edge falls into the middle of a "
        f"pixel, that pixel sees two cells at once.</p><ul>{told}</ul>" + plot(path, "map of cells")
    )  # fmt: skip


def _delay(run: LinkRun) -> str:
    path = run.folder / "figures" / "latency.png"
    if not run.delays.size:
        return "<h2>Latency</h2><p>No group was verified.</p>"
    delay_figure(run, path)
    told = float(np.median(run.delays)) / 1e6
    rows = [
        [row.stage, f"{row.min_us:.6g}", f"{row.median_us:.6g}", f"{row.max_us:.6g}"]
        for row in run.result.latency
    ]
    return (
        "<h2>From a byte to its arrival</h2><p>Time in the simulated machine. Encoder: a byte "
        "waits until its group of symbols is full, at the coded rate; a line-code word is as long "
        "as the group. Panel: the group is shown. Air: light's time. Readout: until the camera's "
        "row and cycle are latched. Decoder: until the receiver has verified the group; computing "
        f"takes no time here.</p><p><code>latency_us</code>, {told:.6g} us, counts from a group's "
        "first light on the panel to the end of the camera cycle in which it was verified, the "
        "median over groups: the encoder's wait is not in it.</p>"
        + plot(path, "latency by stage")
        + table(["stage", "least, us", "median, us", "most, us"], rows)
    )  # fmt: skip


def _tags(run: LinkRun) -> str:
    """From which distance on the tags are too small."""
    far = [row.distance for row in run.reach if not row.tags]
    if not far:
        return ""
    return (
        f" From {min(far):.3g} m on: tags too small. A module of theirs needs "
        f"{least_module(run.scene.blur):.2g} camera pixels, and a panel whose tags are not found "
        "is not read, however large its cells."
    )


def _reach(run: LinkRun) -> str:
    path = run.folder / "figures" / "reach.png"
    tags = _tags(run)
    if not any(row.rate for row in run.reach):
        return f"<h2>Rate against distance</h2><p>No distance is foreseen to work.{tags}</p>"
    reach_figure(run, path)
    return (
        "<h2>Rate against distance</h2><p>A prediction from geometry and closed forms, not a "
        "measurement, with this panel, lens, light and camera, over the modes that a run tries on "
        "its own: a resolved panel's image is as bright at any distance, but smaller, so cells "
        "must grow; nearer than the line begins, the panel does not fit "
        f"into the view. Only the dots come from this run.{tags}</p>"
        + plot(path, "rate against distance")
    )  # fmt: skip


def _verdict(run: LinkRun) -> str:
    good = run.verdict.cause is Cause.NONE
    head = "Received whole" if good else f"Verdict: {run.verdict.cause.value}"
    return f"<h2>{html.escape(head)}</h2><p>{html.escape(run.verdict.told)}</p>"


def _again(run: LinkRun) -> str:
    lines = [
        f"viform run {shlex.quote(str(run.folder / 'scenario.toml'))}",
        f"viform link receive {shlex.quote(str(run.folder / 'stream.zarr'))} --out again",
    ]
    return (
        "<h2>Make it again</h2><p>The first line makes the same bits; the second reads the file "
        f"out of the recording once more.</p><pre>{html.escape(chr(10).join(lines))}</pre>"
        f"<h2>The resolved scenario</h2><pre>{html.escape(to_toml(run.scenario))}</pre>"
    )


def write_link_report(run: LinkRun) -> list[str]:
    """Writes figures and report.html into the run's folder; their names."""
    begin = time.perf_counter()
    (run.folder / "figures").mkdir(exist_ok=True)
    parts = [
        _verdict(run), _rates(run), _delay(run), _errors(run), _cells(run), _view(run), _reach(run),
        kept_section(run), machine_section(run),
    ]  # fmt: skip
    run.seconds["report"] = time.perf_counter() - begin
    chip = run.setting.camera
    body = [
        opening(
            run.scenario.title,
            f"{chip.chip.title}, {chip.clock.hz / 1e3:g} kHz, a panel of {run.mode.width} x "
            f"{run.mode.height} pixels at {run.setting.air.distance:g} m",
            run.result, run.notes,
        ),
        _cards(run), *parts, run_time(run.result, run.seconds), _again(run),
    ]  # fmt: skip
    write_page(run.folder, run.scenario.title, "".join(body))
    figures = sorted(path.name for path in (run.folder / "figures").glob("*.png"))
    return [*(f"figures/{name}" for name in figures), "report.html"]
