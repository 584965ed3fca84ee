"""What pages are made of: pictures held inside the page, and tables."""

from __future__ import annotations

import base64
import html
from typing import Any

from scenarios.png import encode

__all__ = ["data", "figure", "table"]


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
