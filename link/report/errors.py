"""The report's sections on bit errors: raw errors against theory, with eye diagram and soft values,
and errors by cell, with an explorer of single cells' soft values.
"""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import count, number, percent
from cosim.report.explorer import explorer, packed
from cosim.report.parts import plot
from link.evaluation.errors import Errors
from link.evaluation.eye import RARE
from link.evaluation.record import LinkEvaluation, Theory
from link.layout import TRAINING
from link.report.figures import errors_figure
from link.report.signal_figures import cells_figure, eye_figure, soft_figure

_TOP: Final = 127
"""Largest level of a soft value."""
_CHANCE = 1e-3
"""Probability of so many errors in the last symbol below which they are reported."""
_LEARNED: Final = (
    f" A receiver learns these laws from the {TRAINING} symbols of the training. Symbols of one "
    "tick need them most: with the clock locked it errs up to twice as often as the theory says, "
    "and less after a longer training."
)


def errors_section(link: LinkEvaluation, figures: Path) -> str:
    """Section; writes its figures."""
    path, theory = figures / "errors.png", link.theory
    data = errors_figure(link, path)
    span = ""
    if theory.interval is not None:
        low, high = (number(end, 2) for end in theory.interval)
        span = f", 99.9 % interval {low} to {high}"
    return (
        f"<h2>Errors</h2><p>{count(link.errors.wrong)} of {count(link.errors.bits)} bits on data "
        f"cells were decided wrongly before any code{span}. The rate according to the soft values "
        "is the mean of 1/(1 + exp |L|) over all of them: their error rate if they were exact. "
        "They take a cell's pixels and ticks as independent, although neighbouring cells "
        "illuminate all of them; the receiver reduces them by a factor estimated from the "
        f"training. {theory_text(link.theory, link.setup.mode.ticks)}{end_text(link.errors)}</p>"
        + plot(path, "raw bit error rates: measured, by the soft values, by theory", data)
        + _eye(link, figures) + _soft(link, figures)
    )  # fmt: skip


def _eye(link: LinkEvaluation, figures: Path) -> str:
    eye = link.eye
    if eye is None:
        return ""
    path = figures / "eye.png"
    data = eye_figure(eye, path)
    text = (
        f"Without {percent(RARE)} of the traces of each bit it is {number(eye.height)} high and "
        f"{number(eye.width)} ticks wide; its middle level is {number(eye.level)}."
        if eye.height > 0
        else f"It is closed: without {percent(RARE)} of the traces of each bit, on and off overlap "
        f"by {number(abs(eye.height))}."
    )
    span = "one tick" if link.mode.ticks == 1 else f"{link.mode.ticks} ticks"
    at = " to ".join(number(tick, 2, sign=True) for tick in eye.sampled)
    return (
        f"<h3>The eye</h3><p>{count(eye.traces)} symbols of data cells, from the recording: spikes "
        "of a cell's pixels, each weighted by the cell's share of its light, "
        f"mean of a window of {span} that slides past the symbol, 1 if all fire. "
        "The phase of a symbol within the camera's ticks differs by row and, because of the "
        "clock offset, by symbol; traces are linear between ticks. "
        f"The window nearest to a symbol lies {at} ticks from its middle. {text} Detectors weight "
        "each tick by its information and use the preceding ones, and make fewer errors than this "
        "sum.</p>"
        + plot(path, "eye diagram: density of the received symbols, and the opening", data)
    )


def theory_text(theory: Theory, ticks: int) -> str:
    """What the theory includes, and what it leaves out. ticks: length of a symbol."""
    span = theory.closed_interval
    if theory.closed is None:
        return (
            "There is no theoretical rate: the closed forms do not model a panel that is hidden, "
            "out of view, mirrored or off its clock, nor rates that underflow."
        )
    if span is None:
        return (
            "The theory is a coarse estimate, the Bhattacharyya bound for independent observations "
            "with normal light of the neighbours: the run may have many times more errors."
        )
    return (
        "The theory uses the exact law of spikes under random light of neighbouring and previous "
        f"cells, 99.9 % limits of the draws {number(span[0], 2)} to {number(span[1], 2)}. It takes "
        "position, phase and the laws of spikes as known, and leaves out turbulence, fog blur and "
        "fixed pattern." + (_LEARNED if ticks == 1 else "")
    )


def end_text(errors: Errors) -> str:
    """A sentence on errors in the transmission's last symbol, if there are significantly many.

    A duration that cuts the transmission leaves darkness after that symbol.
    """
    from scipy.special import pdtrc

    rest = errors.bits - errors.bits // max(errors.symbols, 1)
    if not errors.at_end or not rest:
        return ""
    others = errors.wrong - errors.at_end
    if pdtrc(errors.at_end - 1, (others + 1) / (errors.symbols - 1)) > _CHANCE:
        return ""
    return (
        f" {count(errors.at_end)} of the wrong bits are of the transmission's last symbol, more "
        f"than of others; without that symbol {number(others / rest, 2)} are wrong."
    )


def _soft(link: LinkEvaluation, figures: Path) -> str:
    if link.soft is None or not link.soft.soft.size:
        return ""
    path = figures / "soft.png"
    data = soft_figure(link.soft, path)
    return (
        f"<h3>Soft values</h3><p>Soft values of {count(link.soft.soft.size)} symbols, by the bit "
        "that was sent. A value on the wrong side of 0 is a wrong decision. Values are clipped at "
        "the detector's limit, so the outermost bins may be high.</p>"
        + plot(path, "histogram of soft values by the bit that was sent", data)
    )


def cells_section(link: LinkEvaluation, figures: Path) -> str:
    """Section; writes its figure."""
    path = figures / "cells.png"
    quality = link.received.cell_quality
    if quality is None:
        return "<h2>Cells</h2><p>No cell was read.</p>"
    sure = np.asarray(quality, np.float64)
    data = cells_figure(sure, link.errors.by_cell, link.errors.symbols, path)
    part = explorer(_map(link, sure), "cells")
    facts = "".join(f"<li>{html.escape(each)}</li>" for each in _facts(link))
    return (
        "<h2>Which cells fail</h2><p>Pale: tags and pilots. Stripes or spots are the beat "
        "of the panel's cells and the camera's pixels: a pixel with an edge in its middle receives "
        f"light of two cells.</p><ul>{facts}</ul>"
        + plot(path, "maps of cells: certainty of decisions, and share of wrong ones", data)
        + f"<h3>Point at a cell</h3>{part}"
    )  # fmt: skip


def _map(link: LinkEvaluation, quality: npt.NDArray[np.float64]) -> dict[str, Any]:
    """What the explorer of cells shows; see its script."""
    errors, layout, where = link.errors, link.setup.sent.layout, link.received.registration
    carries = errors.by_cell >= 0
    top = max(float(np.quantile(quality[carries], 0.99)) if carries.any() else 0.0, 1e-6)
    places = errors.places.copy()
    places[:, 1] = layout.data[places[:, 1]]
    matrix = None if where is None else (where.homography / where.homography[2, 2]).ravel()
    return {
        "rows": layout.shape[0], "columns": layout.shape[1], "symbols": errors.symbols,
        "first": TRAINING, "stop": max(link.setup.sent.data_end, TRAINING + 1), "top": top,
        "whole": len(places) == errors.wrong, "side": link.mode.cell,
        "homography": None if matrix is None else matrix.tolist(),
        "sure": packed(np.rint(255 * np.clip(quality / top, 0, 1)).astype(np.uint8)),
        "wrong": packed(errors.by_cell.astype(np.int32)), "places": packed(places),
        "watched": soft_values(link),
    }  # fmt: skip


def levels_of(soft: npt.NDArray[np.floating[Any]], top: float) -> npt.NDArray[np.int8]:
    """Soft values as levels: sign and 127 sqrt(abs(soft) / top), never 0, so that what was decided
    stays the same (a soft value of 0 is decided as off). The root resolves those near a wrong
    decision."""
    size = np.rint(_TOP * np.sqrt(np.clip(np.abs(soft.astype(np.float64)) / top, 0, 1)))
    return np.asarray(np.where(soft > 0, 1, -1) * np.maximum(size, 1), np.int8)


def soft_values(link: LinkEvaluation) -> dict[str, Any] | None:
    """What the explorer shows of single cells; None if no symbol of the file was read.

    In it: `cells` (n,) int32 indices of cells on the panel, ascending; `symbols` (m,) int32; `soft`
    (n, m) int8, from `levels_of`; `sent` bits of symbols `symbols[0]` - 1 to `symbols[-1]` + 1, (n,
    their number), packed; `start` (n,) float32, tick at which symbol 0 begins there; `period`,
    ticks.
    """
    received, sent = link.received, link.setup.sent
    watched, timing, where = received.watched, received.timing, received.registration
    if watched is None or timing is None or where is None or received.mode != link.mode:
        return None
    of_data = (watched.symbols >= TRAINING) & (watched.symbols < sent.data_end)
    symbols, soft = watched.symbols[of_data], watched.soft[of_data].T
    if not symbols.size:
        return None
    top = max(float(np.abs(soft).max()), 1e-6)
    layout, side = sent.layout, link.mode.cell
    places = layout.data[watched.cells]
    row, column = np.divmod(places, layout.shape[1])
    _, v = where.camera((column + 0.5) * side - 0.5, (row + 0.5) * side - 0.5)
    first, stop = int(symbols[0]) - 1, int(symbols[-1]) + 2
    bits = np.stack([sent.bits(n, 1)[0, watched.cells] for n in range(first, stop)], axis=1)
    return {
        "cells": packed(places.astype(np.int32)), "symbols": packed(symbols.astype(np.int32)),
        "soft": packed(levels_of(soft, top)), "sent": packed(np.packbits(bits, axis=1)),
        "start": packed(timing.start(0, v).astype(np.float32)), "period": timing.period,
        "top": top,
    }  # fmt: skip


def _facts(link: LinkEvaluation) -> list[str]:
    """Statements on the position of errors, from the map of errors."""
    wrong, facts = link.errors.by_cell, []
    carries = wrong >= 0
    if not link.errors.symbols or not carries.any():
        return ["No symbol was compared."]
    share = np.where(carries, wrong, 0) / link.errors.symbols
    mean = share[carries].mean()
    facts.append(f"A cell is wrong in {percent(mean)} of its symbols on average, the worst in "
                f"{percent(share.max())}.")  # fmt: skip
    adjacent = np.zeros_like(carries)
    adjacent[:, 1:] |= ~carries[:, :-1]
    adjacent[:, :-1] |= ~carries[:, 1:]
    adjacent[1:] |= ~carries[:-1]
    adjacent[:-1] |= ~carries[1:]
    edge = np.zeros_like(carries)
    edge[[0, -1]] = True
    edge[:, [0, -1]] = True
    facts += _against_grid(link, carries)
    for name, mask in (
        ("at the panel's edge, where half of the neighbourhood is dark", edge),
        ("next to tags and pilots", adjacent & ~edge),
    ):
        mine = mask & carries
        if mine.any():
            facts.append(f"Cells {name}: {percent(share[mine].mean())}.")
    rows, columns = carries.shape
    quarter = [
        share[rows * i // 3 : rows * (i + 1) // 3, columns * j // 3 : columns * (j + 1) // 3]
        for i in range(3) for j in range(3)
    ]  # fmt: skip
    ninth = [float(part.mean()) for part in quarter]
    facts.append(f"Of nine parts of the panel the best has {percent(min(ninth))}, the worst "
                f"{percent(max(ninth))}. They differ by the beat of the grids, the timing of the "
                "rows and turbulence.")  # fmt: skip
    return facts


def _against_grid(link: LinkEvaluation, carries: npt.NDArray[np.bool_]) -> list[str]:
    """Statements on errors against the certainty of cells, and against the grid of camera
    pixels."""
    wrong = link.errors.by_cell[carries]
    if not wrong.sum():
        return []
    sure = np.asarray(link.received.cell_quality, np.float64)[carries]
    by_sure = _fifths(np.argsort(sure, kind="stable"), wrong)
    facts = [
        f"The fifth of cells with the lowest mean |soft value| has {percent(by_sure[0], 2)} of the "
        f"errors, the fifth with the highest {percent(by_sure[4], 2)}"
        + (
            ": errors do not concentrate on the cells that are least certain on average."
            if by_sure[0] < by_sure[4] else "."
        )
    ]  # fmt: skip
    off = _grid_offsets(link, carries)
    if off is not None:
        by_grid = _fifths(np.argsort(off, kind="stable"), wrong)
        near = by_grid[0] > by_grid[4]
        facts.append(
            "The fifth whose edges lie nearest to borders of camera pixels has "
            f"{percent(by_grid[0], 2)} of them, the fifth farthest from them "
            f"{percent(by_grid[4], 2)}: "
            + (
                "a cell aligned with whole pixels has the fewest pixels."
                if near
                else "pixels with light of two cells distinguish them less well."
            )
        )
    return facts


def _grid_offsets(
    link: LinkEvaluation, carries: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64] | None:
    """Distance of each data cell's edges from the nearest border of camera pixels.

    The unit is camera pixels, the larger of both axes; None if the panel was not detected.
    """
    registration = link.received.registration
    if registration is None or link.received.mode != link.mode:
        return None
    row, column = np.nonzero(carries)
    side = link.mode.cell
    off = []
    for right in (0, 1):
        x, y = registration.camera((column + right) * side - 0.5, (row + right) * side - 0.5)
        off += [np.abs(z + 0.5 - np.round(z + 0.5)) for z in (x, y)]
    return np.asarray(np.max(off, axis=0), np.float64)


def _fifths(order: npt.NDArray[np.intp], wrong: npt.NDArray[np.int64]) -> list[float]:
    """Share of all errors in each fifth of the cells, in the given order."""
    parts = np.array_split(wrong[order], 5)
    return [float(part.sum() / wrong.sum()) for part in parts]
