"""The summary at the top of every page: questions of a newcomer, each with its answer."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

Answer = tuple[str, str]
"""A question, and HTML of its answer; one without an answer is left out."""


def summary(title: str, subtitle: str, answers: Sequence[Answer], *, outcome: str = "") -> str:
    """HTML of a page's heading and its summary.

    Args:
        title: title of the page, text.
        subtitle: what it is about in one line, text.
        answers: what was done, how good the result is, how wrong it may be, how long it took, and
            what was left out, as far as the page has them.
        outcome: HTML that stands above the summary, such as the meaning of a failure.
    """
    rows = "".join(
        f"<div><dt>{html.escape(question)}</dt><dd>{answer}</dd></div>"
        for question, answer in answers if answer
    )  # fmt: skip
    above = f'<p class="outcome">{outcome}</p>' if outcome else ""
    return (
        f'<h1>{html.escape(title)}</h1><p class="soft">{html.escape(subtitle)}.</p>{above}'
        f'<section aria-label="Summary"><dl class="answers">{rows}</dl></section>'
    )


def paragraph(text: str) -> str:
    """A paragraph of plain text; "" for none."""
    return f"<p>{html.escape(text)}</p>" if text else ""


def big(figure: str, text: str) -> str:
    """A large figure, and what it is; both plain text."""
    return f'<p><b class="big">{html.escape(figure)}</b></p>{paragraph(text)}'


def listed(lines: Iterable[str]) -> str:
    """A list of plain lines; "" without any."""
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    return f"<ul>{items}</ul>" if items else ""
