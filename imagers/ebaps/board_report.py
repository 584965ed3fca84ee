"""What a run says of the board clock by clock: metrics, latencies, table of the page."""

from __future__ import annotations

import numpy as np

from cosim.clock import PS
from cosim.config.amounts import number
from cosim.run.result import Latency, Metric
from imagers.ebaps.board.adc_lines import error_rate
from imagers.ebaps.board.axi import BEAT_BYTES
from imagers.ebaps.board.cameralink import LinkTiming
from imagers.ebaps.board.crossing import memory_load
from imagers.ebaps.board.handshake import answer_ps, values_a_second
from imagers.ebaps.device.clocked_board import Board


def board_metrics(board: Board) -> dict[str, Metric]:
    """Metrics of the frames that went through; {} before the first."""
    f, alignment = board.figures, board.figures.alignment
    if alignment is None:
        return {}
    rates = [error_rate(x, board.lines.jitter) for x in board.lines.offsets(alignment).tolist()]
    reading = [t for t in f.transfers if t.reads]
    beats = sum(b.beats for t in reading for b in (*t.writes, *t.reads))
    return {
        "board_frames": Metric(f.delivered, "1"),
        "board_pixels_wrong": Metric(f.wrong, "1"),
        "adc_eye": Metric(float(alignment.eyes.min()), "ps"),
        "adc_offset": Metric(float(np.abs(board.lines.offsets(alignment)).max()), "ps"),
        "adc_words_wrong_untrained": Metric(f.untrained, "1"),
        "adc_error_rate": Metric(max(rates), "1"),
        "adc_bits_wrong": Metric(f.bit_errors, "1"),
        "fifo_most": Metric(max(t.most for t in f.transfers), "words"),
        "fifo_overflows": Metric(sum(t.overflows for t in f.transfers), "words"),
        "memory_use": Metric(
            beats / sum(t.clocks for t in reading) if reading else None, "1",
            "no frame was read",
        ),
        "link_use": Metric(
            f.link_pixels / f.link_clocks if f.link_clocks else None, "1", "no frame was delivered"
        ),
        "pixel_blanking": Metric(board.timing.blanking, "1"),
    }  # fmt: skip


def board_latency(board: Board) -> list[Latency]:
    """Time from the last pixel to the memory, from the request of a frame to its first pixel and to
    its last, and from a line's request to its arrival in the second FPGA."""
    written, first, last, lines = [], [], [], []
    for t in board.figures.transfers:
        if t.written:
            written.append(t.written - (t.pixels - 1) * PS // board.clocks.pixel)
        if t.shown[1]:
            first.append(t.shown[0])
            last.append(t.shown[1])
    for over in board.figures.hand_overs:
        lines += over.stored
    named = {
        "last pixel to the memory": written,
        "frame requested to its first pixel read": first,
        "frame requested to its last pixel read": last,
        "line requested to its arrival in the second FPGA": lines,
    }
    return [
        Latency(name, min(us), float(np.median(us)), max(us))
        for name, ps in named.items()
        if (us := [each * 1e-6 for each in ps])
    ]


def board_rows(board: Board) -> list[list[str]]:
    """(what, measured, by the closed form or as printed) of the page."""
    f, clocks = board.figures, board.clocks
    if f.alignment is None:
        return []
    answers = [ps * 1e-3 for over in f.hand_overs for ps in over.answers]
    low, high = (ps * 1e-3 for ps in answer_ps(clocks.display, clocks.display))
    whole, single = (
        values_a_second(clocks.display, clocks.display, columns)
        for columns in (board.timing.columns, 1)
    )
    need = LinkTiming(board.timing.columns, board.timing.rows, rate=board.timing.rate).pixel_rate
    made = board_metrics(board)
    text = {name: "none" if m.value is None else number(m.value, 4) for name, m in made.items()}
    return [
        ["frames and pixels that arrived otherwise than sent",
         f"{text['board_frames']}, {text['board_pixels_wrong']}", "0 pixels"],
        ["narrowest eye of the converter's lines, ps", text["adc_eye"],
         f"of a bit of {number(PS / 80e6)}, jitter {number(board.lines.jitter)}"],
        ["wrong bits from the converter", f"{f.bit_errors} of {f.bits}",
         f"{number(f.expected_errors)} foreseen"],
        ["words wrong without training", f"{number(100 * f.untrained)} %", ""],
        ["most words in the write FIFO", text["fifo_most"], "a burst has 64"],
        ["share of the memory's clocks with data, while a frame is written and five are read",
         text["memory_use"],
         f"{number(_data_share(board), 4)}; with addresses and latency, at 30 frames/s of the "
         f"whole chip, {number(memory_load(hertz=clocks.memory))} is busy"],
        ["answer of the second FPGA, ns",
         f"{number(min(answers), 4)} to {number(max(answers), 4)}" if answers else "none",
         f"{number(low, 4)} to {number(high, 4)}, longer without room for a line"],
        ["values a second between the FPGAs", "",
         f"a handshake a line {number(whole[0] * 1e-6)} to {number(whole[1] * 1e-6)} M, a value "
         f"{number(single[0] * 1e-6)} to {number(single[1] * 1e-6)} M; needed "
         f"{number(need * 1e-6)} M"],
        ["share of the Camera Link's clocks with a pixel", text["link_use"],
         f"{100 * need / clocks.display:.1f} %"],
        ["share of a period without pixels", text["pixel_blanking"],
         "1.7 % at 40 MHz and 30 frames/s"],
    ]  # fmt: skip


def _data_share(board: Board) -> float:
    """Share of the memory's clocks with data while one frame is written at the pixel clock, and as
    many bytes of each region are read."""
    regions = max((len(t.frames) for t in board.figures.transfers), default=0)
    return (1 + regions) * 2 * board.clocks.pixel / (BEAT_BYTES * board.clocks.memory)
