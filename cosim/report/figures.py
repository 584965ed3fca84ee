"""Figures that reports share: sheets and overviews of pictures, and common colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["INK", "LINE", "MARK", "overview_figure", "sheet_figure", "subplots"]

PANEL = 416
"""Width of a picture in the overview, pixels: 3.2 inches at 130 dots an inch."""
INK, LINE, MARK = "#1d2433", "#c8ccd4", "#d9480f"


def subplots(
    rows: int = 1,
    columns: int = 1,
    *,
    figsize: tuple[float, float],
    layout: Any = None,
    **options: Any,
) -> tuple[Any, Any]:
    """A Matplotlib figure for a file and its axes, (figure, axes); options: of `Figure.subplots`.

    Not subplots's: that keeps each figure, takes longer to import, and allows one thread alone.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=figsize, layout=layout)
    return figure, figure.subplots(rows, columns, **options)


def overview_figure(panels: list[tuple[str, npt.NDArray[np.uint8]]], path: Path) -> None:
    """Writes a figure with pictures side by side and their names above."""
    import cv2

    height, width = panels[0][1].shape
    figure, axes = subplots(
        1, len(panels), figsize=(3.2 * len(panels), 3.2 * height / width + 0.35), squeeze=False
    )
    for (name, image), ax in zip(panels, axes[0], strict=True):
        side = (PANEL, max(1, round(PANEL * height / width)))
        small = cv2.resize(image, side, interpolation=cv2.INTER_AREA) if width > PANEL else image
        ax.imshow(small, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        ax.set_title(name, fontsize=10, color=INK)
        ax.axis("off")
    figure.tight_layout(pad=0.3, w_pad=0.4)
    figure.savefig(path, dpi=130, bbox_inches="tight", pad_inches=0.05)


def sheet_figure(
    heads: list[str], rows: list[tuple[str, list[npt.NDArray[np.uint8]]]], path: Path
) -> None:
    """Writes a sheet of pictures: a column for each instant in `heads`, a row for each method."""
    import cv2

    height, width = rows[0][1][0].shape
    wide = min(2.4, 16 / len(heads))
    figure, axes = subplots(
        len(rows), len(heads), squeeze=False,
        figsize=(wide * len(heads), wide * height / width * len(rows) + 0.3),
    )  # fmt: skip
    side = (round(wide * 130), max(1, round(wide * 130 * height / width)))
    for (name, images), line in zip(rows, axes, strict=True):
        for image, ax in zip(images, line, strict=True):
            small = width > side[0]
            scaled = cv2.resize(image, side, interpolation=cv2.INTER_AREA) if small else image
            ax.imshow(scaled, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
            ax.set_xticks([])
            ax.set_yticks([])
            ax.spines[:].set_visible(False)
        line[0].set_ylabel(name, fontsize=9, color=INK)
    for head, ax in zip(heads, axes[0], strict=True):
        ax.set_title(head, fontsize=9, color=INK)
    figure.tight_layout(pad=0.3, w_pad=0.2, h_pad=0.2)
    figure.savefig(path, dpi=130, bbox_inches="tight", pad_inches=0.05)
