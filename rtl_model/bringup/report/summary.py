"""The summary of a bring-up: what was tested, whether the board is right, how sure that is."""

from __future__ import annotations

import html
import math
from typing import Final

from cosim.config.amounts import amount, count, elapsed, number
from cosim.report.parts import Card, cards
from cosim.report.summary import Answer, big, paragraph
from rtl_model.bringup.bench.stage import Report

_CHANCE: Final = 0.05
"""Chance that a line of the stated error rate shows no wrong bit."""


def answers(report: Report) -> list[Answer]:
    """The answers for a newcomer."""
    slowest = max(report.stages, key=lambda stage: stage.seconds)
    return [
        ("What was tested", paragraph(simulated(report))),
        ("Whether the board is right", cards(cards_of(report))),
        ("How wrong the verdict may be", paragraph(_wrong(report))),
        ("How long it took", big(
            elapsed(report.wall_s),
            f"The longest stage, {slowest.name}, took {elapsed(slowest.seconds)}.",
        )),
        ("What was left out", paragraph(_left_out(report))),
    ]  # fmt: skip


def subtitle(report: Report) -> str:
    """The board in one line: its identifier, port and baud."""
    board = (report.board or {}).get("identifier", "no board was identified")
    kind = "simulated board" if report.simulated else "board"
    rate = "" if report.baud is None else f", {report.baud} baud"
    return f"{board}; {kind} at {report.port}{rate}"


def simulated(report: Report) -> str:
    """What was done, for a newcomer."""
    board = "A simulated test board" if report.simulated else "A test board"
    return (
        f"{board} was brought up stage by stage, from the first byte on the wire to whole frames: "
        "each stage tests one thing, and the planes that the board captured are compared with the "
        "cycle model bit by bit."
    )


def cause(report: Report) -> str:
    """HTML of the first failure, "" without one."""
    if report.cause is None:
        return ""
    stage = html.escape(str(report.failed_stage))
    return f"<b>Stage {stage} failed:</b> {html.escape(report.cause)}."


def cards_of(report: Report) -> list[Card]:
    """The main figures."""
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
        ("link", "round_trips_per_s", "1/s", "round trips"),
        ("patterns", "capture_bytes_per_s", "B/s", "capture rate of stage patterns"),
        ("rate", "read_bits_per_s", "bit/s", "payload read"),
        ("rate", "write_bits_per_s", "bit/s", "payload written"),
        ("loss", "loss_percent", "%", "packets lost"),
    ):
        value = report.figure(stage, name)
        if value is not None:
            rows.append(("", amount(value, unit, 4), what))
    return rows


def _wrong(report: Report) -> str:
    """The bits that the verdict rests on, with the error rate that they exclude.

    Of n independent bits none is wrong with chance (1 - p)^n; at 1 - 95 % that is p = -ln(0.05)/n
    (Hanley and Lippman-Hand, JAMA 249:1743, 1983).
    """
    bits, wrong = report.figure("prbs", "bits"), report.figure("prbs", "bits_wrong")
    compared = report.figure("patterns", "bits_compared")
    if not bits and not compared:
        return "The bring-up ended before any bit was compared: nothing is known of the board."
    text = "Nothing is estimated: every bit is compared with the one expected."
    if bits and wrong == 0:
        rate = number(-math.log(_CHANCE) / bits, 2)
        text += (
            f" None of {count(bits)} pseudo-random bits over the line was wrong, so its error rate "
            f"is below {rate} with 95 % confidence; a rarer fault would not have shown."
        )
    if compared:
        text += f" {count(compared)} bits of captured frames were compared with the cycle model."
    return text


def _left_out(report: Report) -> str:
    missed = [stage.name for stage in report.stages if stage.outcome == "left out"]
    text = f"No stage: all {len(report.names)} were run."
    if missed:
        these = f"Stage {missed[0]}" if len(missed) == 1 else f"Stages {', '.join(missed)}"
        text = f"{these}, which depend on stage {report.failed_stage} or would follow it."
        if len(missed) == 1:
            text = text.replace("which depend", "which depends")
    if report.simulated:
        text += (
            " The board is simulated: rates and times are those of the simulation, and neither a "
            "line's electrical faults nor a real clock was measured."
        )
    return text
