"""The report's section on errors by cell."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import percent
from cosim.report.explorer import explorer, packed
from cosim.report.parts import plot
from link.evaluation.record import LinkEvaluation
from link.layout import TRAINING
from link.report.cell_soft import soft_values
from link.report.signal_figures import cells_figure


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
