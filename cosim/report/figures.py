"""Figures: the home of Matplotlib, with settings of our own; sheets and overviews of pictures, and
common colours."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.report.png import write_png

DOTS = 130
"""Dots an inch of figures with pictures."""
PANEL = 416
"""Width of a picture in the overview, dots."""
GAP = 5
"""Dots between two pictures."""
Picture = npt.NDArray[np.uint8]
INK, LINE, MARK = "#1d2433", "#c8ccd4", "#d9480f"


_TURN_S: Final = 0.0005
"""How long the interpreter stays with one thread while modules are imported, s."""
_SETTINGS = threading.RLock()
_kept = ExitStack()
_users = 0
"""The user's settings while ours hold, and the number of contexts in which they hold."""


def load_ahead(*, figures: bool) -> None:
    """Imports in a thread what a run needs: zarr, which its recorder waits for (0.13 s of one core)
    and then Matplotlib for figures to come (0.4 s). A recording leaves some of the second core; its
    threads take turns with the import, of `_TURN_S` each and not of 5 ms."""

    def load() -> None:
        turn = sys.getswitchinterval()
        sys.setswitchinterval(min(turn, _TURN_S))
        try:
            with suppress(InputError, ImportError, OSError):  # raised again where it is used
                import_module("zarr")
                if figures:
                    _matplotlib()
                    for name in ("matplotlib.figure", "matplotlib.backends.backend_agg"):
                        import_module(name)
        finally:
            sys.setswitchinterval(turn)

    threading.Thread(target=load, daemon=True).start()


def _matplotlib() -> Any:
    """The module. Raises InputError if it cannot read the user's settings."""
    try:
        with _SETTINGS, _without_a_file_of_the_folder():
            return import_module("matplotlib")
    except (PermissionError, ValueError) as exc:  # UnicodeDecodeError is a ValueError
        why = " ".join(str(exc).split())
        raise InputError(
            "Matplotlib's settings", "a file matplotlibrc in UTF-8 and a back end that it knows",
            why, "mend them, or work in a folder without matplotlibrc and unset MPLBACKEND",
        ) from exc  # fmt: skip


@contextmanager
def _without_a_file_of_the_folder() -> Iterator[None]:
    """A context in which Matplotlib, as a command imports it, finds no matplotlibrc in the working
    folder. It reads that before MATPLOTLIBRC, which scenarios/cli/start.py has set, and has no
    option for it."""
    exists = os.path.exists
    if os.environ.get("MATPLOTLIBRC") == os.devnull:
        os.path.exists = lambda path: path != "matplotlibrc" and exists(path)
    try:
        yield
    finally:
        os.path.exists = exists


@contextmanager
def own_settings() -> Iterator[None]:
    """A context in which Matplotlib has its defaults, in all threads; a user's matplotlibrc, styles
    and rcParams would change our figures, or end a run for lack of LaTeX. They hold again after it.
    Raises InputError if Matplotlib cannot be imported with them."""
    global _users
    matplotlib = _matplotlib()
    with _SETTINGS:
        if not _users:
            _kept.enter_context(matplotlib.rc_context())
            _set_defaults(matplotlib)
        _users += 1
    try:
        yield
    finally:
        with _SETTINGS:
            _users -= 1
            if not _users:
                _kept.close()


def _set_defaults(matplotlib: Any) -> None:
    """Not `rcdefaults`, which reads all styles of the user."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # settings that are going out of use
        defaults = dict(matplotlib.rcParamsDefault)
        del defaults["backend"]
        matplotlib.rcParams.update(defaults)


def _figure(**options: Any) -> Any:
    """A new figure, not pyplot's: that keeps each figure, takes longer to import, and allows one
    thread alone. options: of `Figure`."""
    _matplotlib()
    from matplotlib.figure import Figure

    return Figure(**options)


def canvas_of(figure: Any) -> Any:
    """The canvas on which a figure is drawn before it is written, to measure its text."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    return FigureCanvasAgg(figure)


def subplots(
    rows: int = 1,
    columns: int = 1,
    *,
    figsize: tuple[float, float],
    layout: Any = None,
    **options: Any,
) -> tuple[Any, Any]:
    """A Matplotlib figure for a file and its axes, (figure, axes). options: of its `subplots`."""
    figure = _figure(figsize=figsize, layout=layout)
    return figure, figure.subplots(rows, columns, **options)


def overview_figure(panels: list[tuple[str, Picture]], path: Path) -> None:
    """Writes a figure with pictures side by side and their names above."""
    names, pictures = zip(*panels, strict=True)
    _sheet(list(names), [("", list(pictures))], PANEL, 10, path)


def sheet_figure(heads: list[str], rows: list[tuple[str, list[Picture]]], path: Path) -> None:
    """Writes a sheet of pictures: a column for each instant in `heads`, a row for each method."""
    _sheet(heads, rows, round(min(2.4, 16 / len(heads)) * DOTS), 9, path)


def _sheet(
    heads: list[str], rows: list[tuple[str, list[Picture]]], wide: int, points: int, path: Path
) -> None:
    """Writes pictures of one size, dot by dot, around which Matplotlib draws the text:
    its axes would resample each and take longer.

    Args:
        wide: width of a picture, dots; its height keeps its shape.
        points: size of the text.
    """
    import cv2

    height, width = rows[0][1][0].shape
    tall, text = max(1, round(wide * height / width)), round(2.2 * points * DOTS / 72)
    left = text if any(name for name, _ in rows) else 0
    whole_y, whole_x = text + len(rows) * (tall + GAP), left + len(heads) * (wide + GAP)
    figure = _figure(figsize=(whole_x / DOTS, whole_y / DOTS), dpi=DOTS)
    style: Any = {"fontsize": points, "color": INK, "ha": "center", "va": "center"}
    for column, head in enumerate(heads):
        middle = left + column * (wide + GAP) + wide / 2
        figure.text(middle / whole_x, 1 - text / 2 / whole_y, head, **style)
    for line, (name, _) in enumerate(rows):
        middle = text + line * (tall + GAP) + tall / 2
        figure.text(left / 2 / whole_x, 1 - middle / whole_y, name, rotation=90, **style)
    canvas = canvas_of(figure)
    canvas.draw()  # the text
    sheet = np.asarray(canvas.buffer_rgba())[:, :, 1].copy()  # grey
    for line, (_, pictures) in enumerate(rows):
        for column, picture in enumerate(pictures):
            how = cv2.INTER_AREA if width > wide else cv2.INTER_NEAREST
            y, x = text + line * (tall + GAP), left + column * (wide + GAP)
            sheet[y : y + tall, x : x + wide] = cv2.resize(picture, (wide, tall), interpolation=how)
    write_png(path, sheet)
