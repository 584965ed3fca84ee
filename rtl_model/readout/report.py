"""Metrics of the readout in a run, and its section of the report with a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from cosim.config.amounts import amount, count, number, percent
from cosim.report.drawn import Data, save_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from cosim.report.parts import plot, table
from cosim.run.result import Latency, Metric
from rtl_model.readout.buffer import ROW_BYTES
from rtl_model.readout.scan import BIT_RATE, Window
from rtl_model.readout.stage import ScanStage

FIGURE: Final = "figures/readout.png"
_COLUMNS: Final = 400
"""Points of a curve in the figure, at most: each has the largest fill, and the mean loss, of as
many cycles."""


def readout_metrics(stage: ScanStage, lanes: int) -> dict[str, Metric]:
    """Figures of the readout by name, after the last block.

    Args:
        stage: the stage.
        lanes: serial outputs of the chip.
    """
    buffer = stage.buffer
    delays = buffer.delays_us
    _, median, most = (None, None, None) if delays is None else delays
    return {
        "readout_offered_bytes": Metric(buffer.offered * ROW_BYTES, "bytes"),
        "readout_delivered_bytes": Metric(buffer.delivered * ROW_BYTES, "bytes"),
        "readout_lost_bytes": Metric(buffer.lost * ROW_BYTES, "bytes"),
        "readout_lost_rows": Metric(buffer.lost, "rows"),
        "readout_latency_median_us": Metric(median, "us", "no row was delivered"),
        "readout_latency_max_us": Metric(most, "us", "no row was delivered"),
        "readout_buffer_peak_bytes": Metric(int(stage.fill.max(initial=0)), "bytes"),
        "readout_lanes": Metric(lanes, "1"),
        "readout_lane_bps": Metric(BIT_RATE / lanes, "bit/s"),
        "readout_link_bps": Metric(buffer.rate, "bit/s"),
    }


def readout_latency(stage: ScanStage) -> list[Latency]:
    """The row of the readout among the latencies of a run; [] if no row reached the host."""
    delays = stage.buffer.delays_us
    return [] if delays is None else [Latency("latch to host", *delays)]


def loss_note(stage: ScanStage, needed_bps: int) -> str | None:
    """What was lost and why, in one line; None if nothing was.

    needed_bps: least rate of the link at which nothing is lost.
    """
    buffer = stage.buffer
    if not buffer.lost:
        return None
    return (
        f"readout: {count(buffer.lost)} of {count(buffer.offered)} rows were lost: the link behind "
        f"the chip carries {amount(buffer.rate, 'bit/s', 4)}, and with a buffer of "
        f"{count(buffer.size)} bytes nothing is lost from {amount(needed_bps, 'bit/s', 6)} on"
    )


def readout_line(stage: ScanStage) -> str:
    """The readout in one line, below the table of a display."""
    buffer, delays = stage.buffer, stage.buffer.delays_us
    text = (
        f"readout: {count(buffer.delivered * ROW_BYTES)} of {count(buffer.offered * ROW_BYTES)} "
        "bytes reached the host"
    )
    if delays is None:
        return text
    return f"{text}, {number(delays[1], 4)} µs after their latch, at most {number(delays[2], 4)} µs"


def readout_section(stage: ScanStage, lanes: int, folder: Path) -> str:
    """HTML of the section; writes its figure into the folder of the run."""
    buffer = stage.buffer
    timing = buffer.timing
    rows, delays = timing.blocks // 2, buffer.delays_us
    cycle_us = 1e6 / timing.clock.hz
    scan_us = timing.scan_ps / 1e6
    data = _figure(stage, folder / FIGURE)
    texts = [
        ["rows of a plane that are read", count(rows)],
        ["rate of the chip", f"{amount(BIT_RATE, 'bit/s', 4)} in {lanes} lane"
         f"{'s' * (lanes > 1)} of {amount(BIT_RATE / lanes, 'bit/s', 4)}"],
        ["a scan takes", f"{number(scan_us, 4)} µs, then {number(cycle_us - scan_us, 4)} µs blank"],
        ["rate of the link to the host", amount(buffer.rate, "bit/s", 6)],
        ["buffer", f"{count(buffer.size)} bytes, at most {count(int(stage.fill.max(initial=0)))} "
         "used"],
        ["offered by the chip", f"{count(buffer.offered * ROW_BYTES)} bytes"],
        ["delivered to the host", f"{count(buffer.delivered * ROW_BYTES)} bytes"],
        ["lost", f"{count(buffer.lost * ROW_BYTES)} bytes: {count(buffer.lost)} rows, "
         f"{percent(buffer.lost / buffer.offered)}"],
    ]  # fmt: skip
    if delays is not None:
        texts.append(
            ["from latch to host", f"median {number(delays[1], 4)} µs, at most "
             f"{number(delays[2], 4)} µs"]
        )  # fmt: skip
    seen = (
        "No row was lost, so all that follows has the chip's own bits."
        if not buffer.lost and timing.window == Window()
        else "Rows that were lost or not read are dark in the recorded stream and in all that is "
        "computed from it."
    )
    what = "fill of the buffer, and rows lost a plane, over the run"
    return (
        "<h2>From the chip to the host</h2><p>The chip sends each plane row by row, in blocks of "
        "500 pixels with a marker that names their place, during the cycle after its latch. The "
        "rows wait in a buffer for the link to the host. The scan cannot wait: a row that finds no "
        "room is lost as a whole. "
        f"{seen}</p>{table(['readout', 'value'], texts)}{plot(folder / FIGURE, what, data)}"
    )


def _figure(stage: ScanStage, path: Path) -> Data:
    cycles = len(stage.fill)
    each = -(-cycles // _COLUMNS)
    firsts = np.arange(0, cycles, each)
    ms = (firsts + 1) * 1e3 / stage.buffer.timing.clock.hz
    fill = np.maximum.reduceat(stage.fill, firsts) / 1e3
    lost = np.add.reduceat(np.bitwise_count(stage.lost).sum(axis=1, dtype=np.int64), firsts)
    lost = lost / np.diff(np.append(firsts, cycles))
    figure, (above, below) = subplots(
        2, 1, figsize=(7.2, 3.4), layout="constrained", sharex=True
    )  # fmt: skip
    above.plot(ms, fill, drawstyle="steps-post", color=INK, lw=1.2, label="fill")
    size = stage.buffer.size / 1e3
    if size <= 4 * max(fill.max(), 1e-3):
        above.axhline(size, color=MARK, lw=1, ls="--")
        above.annotate(
            "the buffer", (1, size), xycoords=("axes fraction", "data"), ha="right", va="bottom",
            fontsize=8, color=MARK,
        )  # fmt: skip
    above.set_ylim(0, 1.2 * (size if size <= 4 * fill.max() else fill.max()))
    above.set_ylabel("largest fill, kB", fontsize=8.5)
    below.plot(ms, lost, drawstyle="steps-post", color=MARK, lw=1.2, label="rows lost")
    below.set_ylim(0, max(1.2 * lost.max(), 1.0))
    below.set_ylabel("rows lost a plane", fontsize=8.5)
    below.set_xlabel("time, ms", fontsize=8.5)
    below.set_xlim(0, None)
    for ax in (above, below):
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(color=LINE, labelcolor=INK, labelsize=8)
        for axis in (ax.xaxis, ax.yaxis):
            axis.label.set_color(INK)
    return save_figure(figure, path)
