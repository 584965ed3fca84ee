"""Reading a report as text."""

from __future__ import annotations

import re
from pathlib import Path


def page_of(folder: Path) -> str:
    """The HTML of a run's report without the marks of terms, which may stand in any sentence."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    return re.sub(r"</?dfn[^>]*>", "", page)
