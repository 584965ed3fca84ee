"""A whole page: one file that asks for nothing else, with style, script, contents and terms."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Final

from cosim.files.atomic import atomic_write
from cosim.report.explorer import kinds_in
from cosim.report.glossary import explained, terms_list
from cosim.run.called import as_called

_POLICY: Final = (
    "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; form-action 'none'; base-uri 'none'"
)
"""What the browser may load: only what the page itself holds."""
_HEADING: Final = re.compile(r"<h2>(.*?)</h2>", re.S)
_LARGE: Final = (
    '<dialog id="large" aria-labelledby="large-caption"><div class="bar">'
    '<p id="large-caption"></p><a id="large-save" download>Save picture</a>'
    '<button type="button" id="large-close">Close</button></div>'
    '<div class="stage"><img id="large-picture" alt=""></div></dialog>'
    '<div id="definition" role="tooltip" hidden></div>'
)
"""What the script fills: an enlarged figure, and the definition of a term."""


def _contents(body: str) -> tuple[str, str]:
    """Gives every section an anchor; returns the HTML and the list of links to them."""
    links: list[str] = []
    known: set[str] = set()

    def anchor(found: re.Match[str]) -> str:
        text = re.sub(r"<[^>]*>", "", found[1])
        name = re.sub(r"\W+", "-", html.unescape(text).lower()).strip("-") or "section"
        while name in known:
            name += "-"
        known.add(name)
        links.append(f'<li><a href="#{name}">{text}</a></li>')
        return f'<h2 id="{name}">{found[1]}</h2>'

    anchored = _HEADING.sub(anchor, body)
    return anchored, f'<nav aria-label="Sections"><ul>{"".join(links)}</ul></nav>'


def _own(name: str) -> str:
    """A file of this package's style and script."""
    return (files("cosim.report") / "script" / name).read_text(encoding="utf-8")


def _explorers(kinds: Sequence[str]) -> str:
    """The script of explorers of these kinds: one scope, for they share names."""
    parts = [_own(f"{name}.js") for name in ("shared", *kinds, "start")]
    return f'(() => {{\n"use strict";\n{"".join(parts)}}})();'


def _unbroken(part: str) -> str:
    """Powers of ten stay in one line with their number."""
    return part.replace(" × 10", "\u00a0×\u00a010")


def whole_page(
    title: str,
    head: str,
    sections: str,
    *,
    scripts: Sequence[str] = (),
    policy: str = _POLICY,
) -> str:
    """A page as HTML, with the script of explorers if it holds any.

    Args:
        title: title of the page, text.
        head: HTML before the list of sections: heading and what comes first.
        sections: HTML of the sections, each of which begins with <h2>.
        scripts: further JavaScript, as text, which runs when all of the page is there.
        policy: its Content-Security-Policy.
    """
    head, sections = (_unbroken(part) for part in (head, sections))
    head, first = explained(head)
    sections, rest = explained(sections)
    sections, contents = _contents(sections + terms_list({*first, *rest}))
    kinds = kinds_in(head + sections)
    css = [_own(f"{name}.css") for name in ("page", "explorer")[: 2 if kinds else 1]]
    js = [_own("page.js"), *([_explorers(kinds)] if kinds else []), *scripts]
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>{html.escape(title)}</title>"
        + "".join(f"<style>{text}</style>" for text in css)
        + '</head><body><a class="skip" href="#main">Skip to the report</a>'
        f'<main id="main" tabindex="-1">{head}{contents}{sections}</main>{_LARGE}'
        + "".join(f"<script>{_inline(text)}</script>" for text in js)
        + "</body></html>\n"
    )


def write_page(
    folder: Path, title: str, head: str, sections: str, scripts: Sequence[str] = ()
) -> None:
    """Writes report.html into a folder, its commands as the user calls them. The other arguments
    are those of `whole_page`."""
    with atomic_write(folder / "report.html") as part:
        page = whole_page(title, as_called(head), as_called(sections), scripts=scripts)
        # A name in another encoding is no text of UTF-8.
        part.write_text(page, encoding="utf-8", errors="backslashreplace")


def _inline(script: str) -> str:
    """A script that does not end its element early."""
    return re.sub(r"</(?=script)", r"<\\/", script, flags=re.I)
