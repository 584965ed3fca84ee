"""The page of a bring-up: every stage, captured planes beside the expected, the threshold sweep."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

from cosim.report.parts import cards, plot, table, write_page
from cosim.run.result import viform_version
from rtl_model.bringup import Report, Stage, write_junit
from rtl_model.bringup.figures import planes_figure, threshold_figure
from rtl_model.bringup.text import summary

__all__ = ["JUNIT", "write_board_report"]

JUNIT = "junit.xml"
_NOT_SHOWN = {"rates", "first_wrong", "note"}


def write_board_report(report: Report, folder: Path, notes: list[str] | None = None) -> list[str]:
    """Writes report.html, its figures and junit.xml into `folder`; their names.

    notes: lines for the page's head.
    """
    names = ["report.html", JUNIT]
    pictures = []
    if report.bursts:
        name = "figures/planes.png"
        planes_figure(report.bursts, folder / name)
        names.append(name)
        pictures.append(_planes(report, folder / name))
    rates = report.figure("threshold", "rates")
    if rates:
        name = "figures/threshold.png"
        threshold_figure(rates, folder / name)
        names.append(name)
        pictures.append(
            "<h2>Threshold sweep</h2><p>Constant light of "
            f"{report.figure('threshold', 'electrons')} electrons a 40 kHz tick. Lines: the "
            "closed form; points: counted by the board.</p>" + plot(folder / name, "rates")
        )
    body = _head(report, notes or []) + _cards(report) + _stages(report)
    body += "".join(pictures) + "".join(_figures(stage) for stage in report.stages)
    write_page(folder, "Bring-up of a board", body)
    write_junit(report, folder / JUNIT)
    return names


def _head(report: Report, notes: list[str]) -> str:
    board = (report.board or {}).get("identifier", "no board was identified")
    kind = "simulated board" if report.simulated else "board"
    told = "".join(f"<li>{html.escape(note)}</li>" for note in notes)
    cause = "" if report.cause is None else (
        f"<p><b>Stage {html.escape(str(report.failed_stage))} failed:</b> "
        f"{html.escape(report.cause)}.</p>"
    )  # fmt: skip
    return (
        f"<h1>Bring-up of a board</h1><p class='soft'>{html.escape(str(board))}; {kind} at "
        f"{html.escape(report.port)}, {report.baud} baud, viform {viform_version()}.</p>"
        f"<ul>{told}</ul>{cause}"
    )


def _cards(report: Report) -> str:
    passed = sum(stage.outcome == "ok" for stage in report.stages)
    verdict = "every stage passes" if report.ok else f"stage {report.failed_stage} failed"
    rows: list[tuple[str, str, str]] = [
        ("first", "ok" if report.ok else "not passed", verdict),
        ("first", f"{passed} of {len(report.stages)}", "stages"),
    ]
    if report.bursts:
        wrong = sum(0 if burst.wrong is None else burst.wrong.bits for burst in report.bursts)
        rows.append(("", f"{wrong}", "bits wrong of those compared"))
        rows.append(("", f"{sum(len(burst.got) for burst in report.bursts)}", "frames compared"))
    for stage, name, scale, unit, what in (
        ("counters", "round_trips_per_s", 1, "/s", "round trips"),
        ("patterns", "capture_bytes_per_s", 1e-3, " kB/s", "captured, in the patterns' bursts"),
    ):
        value = report.figure(stage, name)
        if value is not None:
            rows.append(("", f"{value * scale:.4g}{unit}", what))
    rows.append(("", f"{report.wall_s:.1f} s", "in all"))
    return cards(rows)


def _stages(report: Report) -> str:
    rows = [
        [stage.name, stage.outcome, f"{stage.seconds:.2f} s", summary(stage)]
        for stage in report.stages
    ]
    return "<h2>Stages</h2>" + table(["stage", "outcome", "took", "what was found"], rows)


def _planes(report: Report, path: Path) -> str:
    told = []
    for burst in report.bursts:
        if burst.wrong is not None:
            text = f"{burst.name}: {burst.wrong.text}; {burst.wrong.mend}."
            told.append(f"<li>{html.escape(text)}</li>")
    wrong = "".join(told) or "<li>No bit is wrong.</li>"
    return (
        "<h2>Captured planes</h2><p>Each burst begins without charge; what it must contain is the "
        f"cycle model's. The first wrong bit is circled.</p><ul>{wrong}</ul>"
        + plot(path, "captured planes and wrong bits")
    )


def _figures(stage: Stage) -> str:
    shown = {name: value for name, value in stage.figures.items() if name not in _NOT_SHOWN}
    if not shown:
        return ""
    rows = [[name.replace("_", " "), _value(value)] for name, value in shown.items()]
    return f"<h2>Figures of stage {stage.name}</h2>" + table(["what", "value"], rows)


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    return str(value)
