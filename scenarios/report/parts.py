"""What every report page is put together from."""

from __future__ import annotations

import base64
import html
from importlib.resources import files
from pathlib import Path
from typing import Any

from cosim.files.whole import whole
from scenarios.png import encode

__all__ = ["cards", "data", "figure", "table", "write_page"]


def data(content: bytes, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def figure(image: Any, caption: str, *, exact: bool = False, css: str = "") -> str:
    """A picture with its caption; `exact` keeps every pixel (PNG), else JPEG."""
    content = encode(image, ".png" if exact else ".jpg")
    source = data(content, "image/png" if exact else "image/jpeg")
    pixels = ' class="pixels"' if exact else ""
    return (
        f'<figure class="{css}"><img{pixels} src="{source}" alt="{html.escape(caption)}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def table(head: list[str], rows: list[list[str]]) -> str:
    cells = "".join(f"<th>{html.escape(h)}</th>" for h in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f'<div class="scroll"><table><tr>{cells}</tr>{body}</table></div>'


def cards(rows: list[tuple[str, str, str]]) -> str:
    """Large figures in a row: (css class, figure, what it is)."""
    texts = (
        f'<div class="card {css}"><b>{html.escape(big)}</b>'
        f'<span class="soft">{html.escape(small)}</span></div>'
        for css, big, small in rows
    )
    return f'<div class="cards">{"".join(texts)}</div>'


def write_page(folder: Path, title: str, body: str) -> None:
    """report.html: one file, no network."""
    css = (files("scenarios.report") / "style.css").read_text()
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{css}</style></head>"
        f"<body><main>{body}</main></body></html>\n"
    )
    with whole(folder / "report.html") as part:
        part.write_text(page, encoding="utf-8")
