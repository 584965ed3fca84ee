"""The HTML report of a bring-up: stages, captured and expected planes, threshold sweep."""

from __future__ import annotations

import html
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosim.config.amounts import amount, count, elapsed, number
from cosim.report.drawn import Data
from cosim.report.page import write_page
from cosim.report.parts import Card, cards, plot, table
from cosim.run.result import viform_version
from rtl_model.bringup.bench.stage import Report, Stage
from rtl_model.bringup.report.figures import planes_figure, threshold_figure
from rtl_model.bringup.report.junit import write_junit
from rtl_model.bringup.report.summary import summary

__all__ = ["TITLE", "Sections", "make_sections", "simulated", "subtitle", "write_board_report"]

TITLE = "Bring-up of a board"
JUNIT = "junit.xml"
_OMITTED = {"rates", "first_wrong", "note"}


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
    head = (
        f"<h1>{TITLE}</h1><p class='soft'>{html.escape(subtitle(report))}, "
        f"viform {viform_version()}.</p><p>{html.escape(simulated(report))}</p>"
    )
    write_page(folder, TITLE, head + _cause(report) + cards(page.cards), "".join(page.sections))
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
    tables = [_figures(stage) for stage in report.stages]
    return Sections(_cards(report), [_stages(report), *pictures, *tables], files)


def subtitle(report: Report) -> str:
    """The board in one line: its identifier, port and baud."""
    board = (report.board or {}).get("identifier", "no board was identified")
    kind = "simulated board" if report.simulated else "board"
    return f"{board}; {kind} at {report.port}, {report.baud} baud"


def simulated(report: Report) -> str:
    """What was done, for a newcomer."""
    board = "A simulated test board" if report.simulated else "A test board"
    return (
        f"{board} was brought up stage by stage, from the first byte on the wire to whole frames: "
        "each stage tests one thing, and the planes that the board captured are compared with the "
        "cycle model bit by bit."
    )


def _cause(report: Report) -> str:
    if report.cause is None:
        return ""
    stage = html.escape(str(report.failed_stage))
    return f"<p><b>Stage {stage} failed:</b> {html.escape(report.cause)}.</p>"


def _cards(report: Report) -> list[Card]:
    passed = sum(stage.outcome == "ok" for stage in report.stages)
    verdict = "every stage passes" if report.ok else f"stage {report.failed_stage} failed"
    rows: list[Card] = [
        ("first", "ok" if report.ok else "not passed", verdict),
        ("first", f"{passed} of {len(report.stages)}", "stages"),
    ]
    if report.bursts:
        wrong = sum(0 if burst.wrong is None else burst.wrong.bits for burst in report.bursts)
        rows.append(("", count(wrong), "wrong bits"))
        rows.append(("", count(sum(len(burst.got) for burst in report.bursts)), "frames compared"))
    for stage, name, unit, what in (
        ("counters", "round_trips_per_s", "1/s", "round trips"),
        ("patterns", "capture_bytes_per_s", "B/s", "capture rate of stage patterns"),
    ):
        value = report.figure(stage, name)
        if value is not None:
            rows.append(("", amount(value, unit, 4), what))
    rows.append(("", elapsed(report.wall_s), "for all stages"))
    return rows


def _stages(report: Report) -> str:
    rows = [
        [stage.name, stage.outcome, elapsed(stage.seconds), summary(stage)]
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


def _figures(stage: Stage) -> str:
    figures = {name: value for name, value in stage.figures.items() if name not in _OMITTED}
    if not figures:
        return ""
    rows = [[name.replace("_", " "), _value(value)] for name, value in figures.items()]
    return f"<h2>Figures of stage {stage.name}</h2>" + table(["what", "value"], rows)


def _value(value: Any) -> str:
    if isinstance(value, int) and not isinstance(value, bool):
        return count(value)
    if isinstance(value, float):
        return number(value, 6)
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    return str(value)
