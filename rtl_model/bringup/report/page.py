"""The HTML report of a bring-up: stages, captured and expected planes, threshold sweep."""

from __future__ import annotations

import html
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from cosim.config.amounts import UNKNOWN, amount, count, elapsed, number
from cosim.report.drawn import Data
from cosim.report.page import write_page
from cosim.report.parts import Card, plot, table
from cosim.report.summary import summary
from cosim.run.result import viform_version
from rtl_model.bringup.bench.stage import Report
from rtl_model.bringup.report.figures import planes_figure, threshold_figure
from rtl_model.bringup.report.junit import write_junit
from rtl_model.bringup.report.stage_text import stage_text
from rtl_model.bringup.report.summary import answers, cards_of, cause, subtitle

TITLE = "Bring-up of a board"
JUNIT = "junit.xml"
_UNITS: Final = {
    "_bits_per_s": ("bit/s", 1.0), "_bytes_per_s": ("B/s", 1.0), "_per_s": ("1/s", 1.0),
    "_hz": ("Hz", 1.0), "_ms": ("s", 1e-3),
}  # fmt: skip
"""Ends of names of figures with their unit, and its size in it."""
_OMITTED: Final = {"rates", "first_wrong", "note"}


@dataclass(frozen=True)
class Sections:
    """The parts that every report of a bring-up contains.

    Attributes:
        cards: the main figures.
        sections: HTML of the sections, in their order.
        files: names of the files written, in the report's folder.
    """

    cards: list[Card]
    sections: list[str]
    files: list[str]


def write_board_report(report: Report, folder: Path) -> list[str]:
    """Writes report.html, its figures and junit.xml into `folder`; returns their names."""
    page = make_sections(report, folder)
    head = summary(
        TITLE, f"{subtitle(report)}, viform {viform_version()}", answers(report),
        outcome=cause(report),
    )  # fmt: skip
    write_page(folder, TITLE, head, "".join(page.sections))
    return ["report.html", *page.files]


def make_sections(report: Report, folder: Path) -> Sections:
    """Writes figures and junit.xml into `folder`; returns the parts of the page."""
    files = [JUNIT]
    pictures = []
    if report.bursts:
        name = "figures/planes.png"
        data = planes_figure(report.bursts, folder / name)
        files.append(name)
        pictures.append(_planes(report, folder / name, data))
    rates = report.figure("threshold", "rates")
    if rates:
        name = "figures/threshold.png"
        data = threshold_figure(rates, folder / name)
        files.append(name)
        pictures.append(
            "<h2>Threshold sweep</h2><p>Constant light of "
            f"{report.figure('threshold', 'electrons')} electrons in a 40 kHz tick. Lines: "
            "closed form. Points: counts of the board.</p>"
            + plot(folder / name, "spikes a pixel and tick against the threshold level", data)
        )
    write_junit(report, folder / JUNIT)
    return Sections(cards_of(report), [_stages(report), *pictures, _figures(report)], files)


def _stages(report: Report) -> str:
    rows = [
        [stage.name, stage.outcome, elapsed(stage.seconds), stage_text(stage)]
        for stage in report.stages
    ]
    return "<h2>Stages</h2>" + table(["stage", "outcome", "time", "result"], rows)


def _planes(report: Report, path: Path, data: Data) -> str:
    lines = []
    for burst in report.bursts:
        if burst.wrong is not None:
            text = f"{burst.name}: {burst.wrong.text}; {burst.wrong.remedy}."
            lines.append(f"<li>{html.escape(text)}</li>")
    wrong = "".join(lines) or "<li>No bit is wrong.</li>"
    return (
        "<h2>Captured planes</h2><p>Each burst starts without charge. The expected planes come "
        "from the cycle model. The first wrong bit is circled.</p>"
        f"<ul>{wrong}</ul>" + plot(path, "expected and captured planes, and wrong bits", data)
    )


def _figures(report: Report) -> str:
    rows = []
    for stage in report.stages:
        figures = [(k, v) for k, v in stage.figures.items() if k not in _OMITTED]
        for n, (name, value) in enumerate(figures):
            rows.append(["" if n else stage.name, *_figure(name, value)])
    if not rows:
        return ""
    return "<h2>Figures of the stages</h2>" + table(["stage", "what", "value"], rows)


def _figure(name: str, value: Any) -> tuple[str, str]:
    """What a figure is, and its text; the end of its name is its unit."""
    what = name.replace("_", " ")
    if isinstance(value, bool) or value is None:
        return what, {True: "yes", False: "no", None: UNKNOWN}[value]
    if isinstance(value, int | float):
        for end, (unit, scale) in _UNITS.items():
            if name.endswith(end):
                return name.removesuffix(end).replace("_", " "), amount(value * scale, unit, 4)
        if name.startswith("s_per_"):
            return f"time for each {what.removeprefix('s per ')}", amount(value, "s", 4)
        return what, count(value) if isinstance(value, int) else number(value, 6)
    if isinstance(value, list | tuple):
        return what, ", ".join(map(str, value))
    return what, str(value)
