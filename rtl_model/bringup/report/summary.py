"""The summary of a bring-up: what was tested, whether the board is right, how sure that is, and a
line for each stage with its main figures.
"""

from __future__ import annotations

import html
import math
from typing import Final

from cosim.config.amounts import amount, count, elapsed, number
from cosim.report.parts import Card, cards
from cosim.report.summary import Answer, big, paragraph
from rtl_model.bringup.bench.stage import Report, Stage

_VERILOG = {
    None: "",
    True: ", this program's Verilog",
    False: ", other Verilog than this program's",
}
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


def stage_text(stage: Stage) -> str:
    """The main figures of a stage that has passed, or the cause of one that has not."""
    if stage.cause is not None:
        return stage.cause
    text = _SUMMARIES[stage.name](stage) if stage.name in _SUMMARIES else ""
    note = stage.figures.get("note")
    return f"{text}; {note}" if text and note else text or str(note or "")


def _bytes(stage: Stage) -> str:
    f = stage.figures
    return f"{f['answers']} answers, {number(1e3 * f['s_per_answer'])} ms each, at {f['baud']} baud"


def _link(stage: Stage) -> str:
    f = stage.figures
    return (
        f"{f['answers']} answers, {number(f['round_trip_ms'])} ms each; probes "
        f"{number(f['probe_ms'])} ms"
    )


def _loss(stage: Stage) -> str:
    f = stage.figures
    return "" if "note" in f else f"none of {f['packets']} packets lost, repeated or reordered"


def _mtu(stage: Stage) -> str:
    f = stage.figures
    return f"{f['words']} words a packet, {f['packet_bytes']} bytes"


def _rate(stage: Stage) -> str:
    f = stage.figures
    return (
        f"payload {amount(f['read_bits_per_s'], 'bit/s')} read, "
        f"{amount(f['write_bits_per_s'], 'bit/s')} written, {f['packets_in_flight']} packets "
        "in flight"
    )


def _identity(stage: Stage) -> str:
    f = stage.figures
    return (
        f"{f['identifier']}, {f['lanes']} lanes, {number(f['clock_hz'] / 1e6)} MHz, map "
        f"{f['version']}, build {f['build']}{_VERILOG[f.get('build_matches')]}"
    )


def _counters(stage: Stage) -> str:
    f = stage.figures
    return (
        f"{f['bytes_counted']} of {f['bytes_sent']} bytes and {f['words_written']} words counted, "
        f"no error; {number(f['round_trips_per_s'], 4)} round trips/s, {number(f['latency_ms'])} "
        "ms beyond the line"
    )


def _registers(stage: Stage) -> str:
    f = stage.figures
    return (
        f"{f['bits_walked']} bits of {f['registers']} registers tested, {f['memory_words']} memory "
        f"words, {f['reset_values']} values after reset"
    )


def _prbs(stage: Stage) -> str:
    f = stage.figures
    return f"orders {', '.join(map(str, f['orders']))}: {f['bits']} bits both ways, none wrong"


def _patterns(stage: Stage) -> str:
    f = stage.figures
    return (
        f"{f['frames_compared']} frames, {f['bits_compared']} bits against the cycle model, none "
        f"wrong; capture {number(f['capture_bytes_per_s'] / 1e3, 4)} kB/s"
    )


def _threshold(stage: Stage) -> str:
    f = stage.figures
    return (
        f"{f['settings']} settings, {f['frames']} frames, every spike count as in the closed form"
    )


def _timing(stage: Stage) -> str:
    f = stage.figures
    text = f"{f['differences']} differences of frame clocks are whole ticks"
    if "clock_error_ppm" in f:
        text += (
            f"; clock {number(f['clock_hz'] / 1e6, 6)} MHz, {f['clock_error_ppm']:+.0f} ppm "
            f"(+-{f['clock_doubt_ppm']:.0f})"
        )
    return text


_SUMMARIES = {
    "bytes": _bytes,
    "link": _link,
    "identity": _identity,
    "loss": _loss,
    "mtu": _mtu,
    "rate": _rate,
    "counters": _counters,
    "registers": _registers,
    "prbs": _prbs,
    "patterns": _patterns,
    "threshold": _threshold,
    "timing": _timing,
}
