"""HTML components of report pages."""

from __future__ import annotations

import base64
import html
from importlib.resources import files
from pathlib import Path
from typing import Any

from cosim.config.amounts import amount
from cosim.files.whole import whole
from cosim.report.png import encode, reduced
from cosim.run.result import Result

__all__ = ["cards", "data", "figure", "opening", "plot", "run_time", "table", "write_page"]


def data(content: bytes, kind: str) -> str:
    """A data URL. kind: MIME type."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def figure(image: Any, caption: str, *, exact: bool = False, css: str = "") -> str:
    """A picture with its caption.

    Args:
        image: of any size; larger pictures than LARGEST_PICTURE are reduced.
        exact: whether it is lossless (PNG) or a JPEG.
        css: class.
    """
    content = encode(reduced(image), ".png" if exact else ".jpg")
    source = data(content, "image/png" if exact else "image/jpeg")
    pixels = ' class="pixels"' if exact else ""
    return (
        f'<figure class="{css}"><img{pixels} src="{source}" alt="{html.escape(caption)}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table of text."""
    cells = "".join(f"<th>{html.escape(h)}</th>" for h in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f'<div class="scroll"><table><tr>{cells}</tr>{body}</table></div>'


def cards(rows: list[tuple[str, str, str]]) -> str:
    """Large figures in a row. rows: (CSS class, figure, description) each."""
    texts = (
        f'<div class="card {css}"><b>{html.escape(big)}</b>'
        f'<span class="soft">{html.escape(small)}</span></div>'
        for css, big, small in rows
    )
    return f'<div class="cards">{"".join(texts)}</div>'


def plot(path: Path, name: str) -> str:
    """A figure from a PNG file. name: alternative text."""
    source = data(path.read_bytes(), "image/png")
    return f'<figure class="plot"><img src="{source}" alt="{html.escape(name)}"></figure>'


def opening(title: str, camera: str, result: Result, notes: list[str]) -> str:
    """The head of a page: title, camera, outcome unless it is "ok", and notes."""
    caveat = "" if result.outcome == "ok" else f" <b>Outcome: {result.outcome}.</b>"
    items = "".join(f"<li>{html.escape(note)}</li>" for note in notes)
    return (
        f'<h1>{html.escape(title)}</h1><p class="soft">{html.escape(camera)}, seed {result.seed}, '
        f"viform {result.version}.{caveat}</p><ul>{items}</ul>"
    )


def run_time(result: Result, seconds: dict[str, float]) -> str:
    """Table of the wall time of each stage, throughputs, and the peak memory."""
    import resource  # POSIX only; pages of boards are written on Windows too

    rows = [[stage, f"{spent:.2f} s"] for stage, spent in seconds.items()]
    rows += [[f"{t.stage} throughput", amount(t.value, t.unit)] for t in result.throughput]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    rows.append(["peak memory", f"{peak:.2f} GiB"])
    return f"<h2>Run time</h2><p>On {html.escape(result.device)}.</p>" + table(
        ["stage", "took"], rows
    )


def write_page(folder: Path, title: str, body: str) -> None:
    """Writes report.html, a single file without external resources."""
    css = (files("cosim.report") / "style.css").read_text()
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{css}</style></head>"
        f"<body><main>{body}</main></body></html>\n"
    )
    with whole(folder / "report.html") as part:
        part.write_text(page, encoding="utf-8")
