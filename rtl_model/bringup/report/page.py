"""The report of a bring-up as files: a page with stages, captured and expected planes, wrong bits
and the threshold sweep, and JUnit XML for build servers, with one test case for each stage.
"""

from __future__ import annotations

import html
import xml.etree.ElementTree as xml
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim.config.amounts import UNKNOWN, amount, count, elapsed, number
from cosim.files.atomic import atomic_write
from cosim.report.drawn import Data, Value, write_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from cosim.report.page import write_page
from cosim.report.parts import Card, plot, table
from cosim.report.summary import summary
from cosim.run.result import viform_version
from rtl_model.bringup.bench.bench import Burst
from rtl_model.bringup.bench.stage import Report
from rtl_model.bringup.report.summary import answers, cards_of, cause, stage_text, subtitle

_MAPPED = 1500
"""Pixels of all bursts up to which the data of the figure hold all, not the wrong ones alone."""
_RULES = {"residual": "#1c7ed6", "hard": "#2b8a3e", "subtract": "#9c36b5"}
# Characters that XML 1.0 forbids, even as entities.
_CONTROLS = [*range(9), 11, 12, *range(14, 32), 0xFFFE, 0xFFFF]
_FORBIDDEN = dict.fromkeys([*_CONTROLS, *range(0xD800, 0xE000)], "?")
TITLE = "Bring-up of a board"
JUNIT = "junit.xml"
_UNITS: Final = {
    "_bits_per_s": ("bit/s", 1.0), "_bytes_per_s": ("B/s", 1.0), "_per_s": ("1/s", 1.0),
    "_hz": ("Hz", 1.0), "_ms": ("s", 1e-3),
}  # fmt: skip
"""Ends of names of figures with their unit, and its size in it."""
_OMITTED: Final = {"rates", "first_wrong", "note"}


def write_board_report(report: Report, folder: Path) -> list[str]:
    """Writes report.html, its figures and junit.xml into `folder`; returns their names."""
    page = make_sections(report, folder)
    head = summary(
        TITLE, f"{subtitle(report)}, viform {viform_version()}", answers(report),
        outcome=cause(report),
    )  # fmt: skip
    write_page(folder, TITLE, head, "".join(page.sections))
    return ["report.html", *page.files]


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


def planes_figure(bursts: list[Burst], path: Path) -> Data:
    """Draws one row for each burst: expected spike counts, captured spike counts, wrong bits.

    All three are summed over the frames for each pixel. The first wrong bit is circled.
    """
    figure, rows = subplots(
        len(bursts), 3, figsize=(9.5, 2.9 * len(bursts)), squeeze=False, layout="constrained"
    )
    found: list[tuple[Value, ...]] = []
    for axes, burst in zip(rows, bursts, strict=True):
        expected, captured = burst.expected.sum(axis=0), burst.got.sum(axis=0)
        wrong = (burst.expected != burst.got).sum(axis=0)
        frames = len(burst.got)
        few = sum(each.got[0].size for each in bursts) <= _MAPPED
        places = np.nonzero(np.ones_like(wrong) if few else wrong)
        found += [
            (burst.name, float(row), float(column),
             *(float(each[row, column]) for each in (expected, captured, wrong)))
            for row, column in zip(*places, strict=True)
        ]  # fmt: skip
        title = "no wrong bit" if burst.wrong is None else f"{count(burst.wrong.bits)} wrong bits"
        for place, plane, text in (
            (axes[0], expected, f"{burst.name}: expected"),
            (axes[1], captured, f"captured, {frames} frames"),
        ):
            image = place.imshow(plane, cmap="gray", vmin=0, vmax=frames, interpolation="nearest")
            place.set_title(text, fontsize=10, color=INK)
        figure.colorbar(image, ax=axes[1], shrink=0.8, label="spikes")
        axes[2].imshow(np.zeros_like(wrong), cmap="gray_r", vmin=0, vmax=1)
        masked = np.ma.masked_equal(wrong, 0)
        axes[2].imshow(masked, cmap="autumn_r", vmin=0, vmax=frames, interpolation="nearest")
        axes[2].set_title(title, fontsize=10, color=MARK if burst.wrong else INK)
        if burst.wrong is not None:
            axes[2].plot(
                burst.wrong.column, burst.wrong.row, "o", markersize=16, markerfacecolor="none",
                markeredgecolor=INK, markeredgewidth=1.2,
            )  # fmt: skip
        for place in axes:
            place.set_xlabel("column", fontsize=8, color=INK)
            place.set_ylabel("row", fontsize=8, color=INK)
            place.tick_params(labelsize=8)
            place.spines[:].set_color(LINE)
    write_figure(figure, path, 120)
    head = ("burst", "row", "column", "spikes expected", "spikes captured", "wrong bits")
    return Data(head, found)


def threshold_figure(rates: list[dict[str, Any]], path: Path) -> Data:
    """Draws spikes per pixel and tick against threshold level, one panel for each clock.

    Lines are the closed form, points the board's counts. A row of `rates` holds `clock` (0 or 1),
    `rule`, `level`, `rate` and `expected`.
    """
    figure, places = subplots(1, 2, figsize=(9.5, 3.6), sharey=True, layout="constrained")
    for select, axes in enumerate(places):
        for rule, colour in _RULES.items():
            rows = [r for r in rates if r["clock"] == select and r["rule"] == rule]
            levels = [r["level"] for r in rows]
            shift = 0.12 * (list(_RULES).index(rule) - 1)  # keeps coinciding points apart
            axes.plot(levels, [r["expected"] for r in rows], color=colour, linewidth=1)
            axes.plot(
                [level + shift for level in levels], [r["rate"] for r in rows], "o", color=colour,
                markersize=4, label=rule,
            )  # fmt: skip
        axes.set_title(f"{20 if select else 40} kHz", fontsize=11, color=INK)
        axes.set_xlabel("threshold level", color=INK)
        axes.grid(color=LINE, linewidth=0.5)
        axes.spines[["top", "right"]].set_visible(False)
    places[0].set_ylabel("spikes a pixel and tick", color=INK)
    places[1].legend(fontsize=9, frameon=False)
    write_figure(figure, path, 120)
    return Data(
        ("rule", "clock, kHz", "threshold level", "spikes/tick, closed form", "spikes/tick, board"),
        [
            (r["rule"], 20.0 if r["clock"] else 40.0, r["level"], r["expected"], r["rate"])
            for r in rates
        ],
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


def write_junit(report: Report, path: Path) -> None:
    """Writes the document atomically."""
    with atomic_write(path) as part:
        part.write_text(junit_xml(report), encoding="utf-8")


def junit_xml(report: Report) -> str:
    """The text of the document. The figures of a stage are the properties of its test case."""
    failed = sum(stage.outcome == "failed" for stage in report.stages)
    skipped = sum(stage.outcome == "left out" for stage in report.stages)
    spent = sum(stage.seconds for stage in report.stages)
    suite = xml.Element(
        "testsuite",
        name="viform.board.bringup",
        tests=str(len(report.stages)),
        failures=str(failed),
        errors="0",
        skipped=str(skipped),
        time=f"{spent:.6f}",
    )
    for stage in report.stages:
        case = xml.SubElement(
            suite,
            "testcase",
            classname="viform.board",
            name=stage.name,
            time=f"{stage.seconds:.6f}",
        )
        if stage.figures:
            properties = xml.SubElement(case, "properties")
            for name, value in stage.figures.items():
                xml.SubElement(properties, "property", name=name, value=_clean(str(value)))
        cause = _clean(stage.cause or "")
        if stage.outcome == "failed":
            failure = xml.SubElement(case, "failure", message=cause, type=stage.kind or "fault")
            failure.text = cause
        elif stage.outcome == "left out":
            xml.SubElement(case, "skipped", message=cause)
    suites = xml.Element("testsuites")
    suites.append(suite)
    xml.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(suites, "unicode") + "\n"


def _clean(text: str) -> str:
    return text.translate(_FORBIDDEN)
