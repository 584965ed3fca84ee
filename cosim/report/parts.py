"""HTML components of report pages."""

from __future__ import annotations

import base64
import html
import re
from pathlib import Path
from typing import Any, Final

from cosim.config.amounts import THIN, amount, elapsed
from cosim.report.drawn import Data
from cosim.report.png import encode, reduced
from cosim.run.result import Result

Card = tuple[str, str, str]
"""CSS class ("first" for the main ones), figure, and what it is."""
_LOW: Final = 480
"""Width up to which a picture is shown with sharp pixels where the page enlarges it, pixels."""
_NUMERIC: Final = re.compile(
    rf"(?:over |at most |about |below )?[+-]?\d[\d.{THIN}]*(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)? ?[%\w/²µ]*"
)
_FEW: Final = 5
"""Columns of a table up to which it may shrink to a narrow screen."""
_WORDY: Final = 160
"""Letters of a row of more than three columns from which it may not: columns of single words."""
_MOST: Final = 12
"""Columns of a table up to which numbers are set flush right."""


def data_url(content: bytes, kind: str) -> str:
    """A data URL. kind: MIME type."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _framed(picture: str, caption: str, css: str, links: str = "") -> str:
    return (
        f'<figure class="{css}">{picture}<figcaption>{html.escape(caption)}'
        f'<span class="tools"><button type="button" class="enlarge">Enlarge</button>{links}</span>'
        "</figcaption></figure>"
    )


def figure(image: Any, caption: str, *, exact: bool = False) -> str:
    """A picture with its caption.

    Args:
        image: pixels of any size; larger pictures than LARGEST_PICTURE are reduced.
        exact: whether it is lossless (PNG) or a JPEG.
    """
    image = reduced(image)
    content = encode(image, ".png" if exact else ".jpg")
    source = data_url(content, "image/png" if exact else "image/jpeg")
    pixels = ' class="pixels"' if image.shape[1] <= _LOW else ""
    return _framed(f'<img{pixels} src="{source}" alt="{html.escape(caption)}">', caption, "picture")


def plot(path: Path, caption: str, data: Data | None = None, *, alt: str | None = None) -> str:
    """A figure from a PNG file.

    Args:
        path: the file.
        caption: what it shows, in one line.
        data: what was drawn, which the page offers as CSV; None for a picture.
        alt: text in its place for who cannot see it; the caption by default.
    """
    source = data_url(path.read_bytes(), "image/png")
    links = ""
    if data is not None and data.rows:
        text, every = data.csv()
        some = "" if every == 1 else f", one point in {every}"
        link = data_url(text.encode(), "text/csv")
        links = (
            f'<a class="data" download="{path.stem}.csv" href="{link}"'
            f' title="What this figure shows, for a spreadsheet or a program">Data (CSV{some})</a>'
        )
    picture = f'<img src="{source}" alt="{html.escape(alt or caption)}">'
    return _framed(picture, caption, "plot", links)


def video(path: Path, caption: str, width: int) -> str:
    """A clip that repeats. width: at which it is shown at most, pixels."""
    return (
        f'<figure class="picture" style="max-width:{width}px"><video controls loop muted autoplay '
        f'playsinline aria-label="{html.escape(caption)}" '
        f'src="{data_url(path.read_bytes(), "video/mp4")}"></video>'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table of text. Columns of numbers are set flush right; "-" stands for no
    number."""
    heads = "".join(f'<th scope="col">{html.escape(h)}</th>' for h in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    columns = {
        n: [row[n] for row in rows if row[n] not in ("", "-")]
        for n in range(1, min(len(head), _MOST + 1))
    }
    numeric = [n for n, cells in columns.items() if cells and all(map(_NUMERIC.fullmatch, cells))]
    wordy = len(head) > 3 and any(sum(map(len, row)) > _WORDY for row in rows)
    css = " ".join(
        [*(["many"] if wordy or len(head) > _FEW else []), *(f"n{n + 1}" for n in numeric)]
    )
    name = html.escape(", ".join(h for h in head if h))
    return (
        f'<div class="wide"><div class="scroll" role="region" aria-label="Table: {name}">'
        f'<table class="{css}"><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>'
        "</div></div>"
    )


def cards(rows: list[Card]) -> str:
    """Large figures in a row."""
    texts = (
        f'<div class="card {css}"><b>{html.escape(big)}</b> '
        f'<span class="soft">{html.escape(small)}</span></div>'
        for css, big, small in rows
    )
    return f'<div class="cards">{"".join(texts)}</div>' if rows else ""


def run_time(result: Result, seconds: dict[str, float], total: float) -> str:
    """Table of the wall time of each stage, throughputs, and the peak memory.

    Args:
        result: result of the run.
        seconds: wall time of each stage, s; stages may run side by side.
        total: wall time of the run so far, s.
    """
    import resource  # POSIX only; pages of boards are written on Windows too

    rows = [[stage, elapsed(spent)] for stage, spent in seconds.items()]
    rest = total - sum(seconds.values())
    beside = "" if rest >= 0 else " Stages run side by side, so they add up to more than the total."
    if rest > 0:
        rows.append(["start, plan, images and all else", elapsed(rest)])
    rows.append(["total", elapsed(total)])
    rows += [[f"{t.stage} throughput", amount(t.value, t.unit)] for t in result.throughput]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    rows.append(["peak memory", amount(peak, "GiB")])
    return f"<h2>Run time</h2><p>On {html.escape(result.device)}.{beside}</p>" + table(
        ["stage", "took"], rows
    )
