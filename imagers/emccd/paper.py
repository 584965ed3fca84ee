"""Document 003: four drive modes of a frame-transfer electron-multiplying CCD."""

from __future__ import annotations

import math

import numpy as np

from cosim.light.radiometry import photons_per_lux
from cosim.run.printed import PrintedRow, listed, number, unprinted
from imagers.emccd.device.controller import DESIGN
from imagers.emccd.device.cooling import Cooler, run_cooling
from imagers.emccd.device.sequencer import CounterSequencer, Cycle, Phase
from imagers.emccd.device.sine_drive import Potentiometer, SineDrive, word_edges
from imagers.emccd.device.supplies import Supplies, breaches
from imagers.emccd.device.timing import (
    Settings,
    Timing,
    after_printed,
    exposure_range,
    frame_clocks,
    window_table,
)
from imagers.emccd.pixels import (
    SUMMARY_PEAK,
    TEXT_PEAK,
    EmccdPixels,
    HighVoltage,
    chip,
    columns_filled,
    electrons_to_fill,
    spill_lines,
)
from sensor.frame_pixels import Exposed

_CITED_MS = 5.165
"""Shortest exposure of the design that the document cites for comparison, ms."""


def emccd_rows() -> list[PrintedRow]:
    """The rows of `viform paper`, in the order of the document."""
    return [*_exposure(), *_chip(), *_gain(), *_rows(), *_overflow(), *_frame(), *_cold()]


def _exposure() -> list[PrintedRow]:
    timing = Timing()
    _, most, step = exposure_range(timing)
    register = next(r for r in DESIGN.specific if r.name == "emccd_exposure")
    beyond = Settings((1 << register.width) - 1).within(timing).steps
    shortest, second, longest = (_exposed(timing, steps) for steps in (1, 2, beyond))
    return [
        number("003 §0", "shortest exposure", "10", shortest * 1e6, "us",
               note="edges between two frame transfers of the sequence", by="component"),
        number("003 §0", "shortest exposure of another design, cited", str(_CITED_MS),
               shortest * 1e3, "ms", relation="<",
               note="ours lies below it; theirs has no first transfer", by="component"),
        number("003 §2", "longest exposure", "40.96", longest * 1e3, "ms",
               note="edges of the sequence, for the largest value of the register",
               by="component"),
        number("003 §2", "step of exposure", "10", (second - shortest) * 1e6, "us",
               note="edges of the sequence", by="component"),
        unprinted("003 §2", "steps of exposure", beyond, holds=beyond == round(most / step),
                  note="40.96 ms in 10 us; what is written beyond is cut to it", by="constant"),
    ]  # fmt: skip


def _exposed(timing: Timing, steps: int) -> float:
    """Seconds between the two frame transfers of a cycle."""
    cycle = Cycle(0, 0, timing, Settings(steps).within(timing))
    return (cycle.exposure_end - cycle.exposure_begin) / timing.clock_hz


def _chip() -> list[PrintedRow]:
    timing, pixels = Timing(), EmccdPixels()
    dark = np.asarray(pixels.convert(
        Exposed(np.full(pixels.shape, 0.01), np.full(pixels.shape[0], 1e-2),
                np.zeros(pixels.shape[0]), 0, 0), 1, frozenset(),
    ))  # fmt: skip
    lit = dark > dark.min()
    rows, columns = np.flatnonzero(lit.any(axis=1)), np.flatnonzero(lit.any(axis=0))
    photons = photons_per_lux(chip.WAVELENGTH) * chip.PITCH**2
    cycle = Cycle(0, 0, timing, Settings(1).within(timing))
    full = EmccdPixels(gain=1000.0).convert(
        Exposed(np.full(pixels.shape, 1e6), np.full(pixels.shape[0], 1e-2),
                np.zeros(pixels.shape[0]), 0, 0), 1, frozenset(),
    )  # fmt: skip
    reading = np.diff(cycle.leaving())
    line = int(reading[reading > timing.line].min()) - timing.shift
    return [
        listed("003 §1", "image rows and columns", [512, 512], [rows.size, columns.size], "pixels",
               note="those of the simulated chip that see light", by="component"),
        listed("003 §1", "rows and columns of image and storage area", [528, 536],
               list(dark.shape), "pixels", note="of a simulated frame", by="component"),
        listed("003 §1", "dark reference rows at head and tail", [8, 8],
               [int(rows[0]), pixels.shape[0] - 1 - int(rows[-1])], "rows", by="component"),
        listed("003 §1", "dark reference columns left and right", [12, 12],
               [int(columns[0]), pixels.shape[1] - 1 - int(columns[-1])], "columns",
               by="component"),
        number("003 §1", "cells of the horizontal register", "536", timing.columns, by="constant"),
        number("003 §1", "cells between it and the multiplication register", "16",
               timing.transition, "clocks", note="clocks from a line's start to its first pixel",
               by="constant"),
        number("003 §1", "pixel clocks of a line", "552", line, "clocks",
               note="between two rows of the sequence, less the shift", by="component"),
        number("003 §1", "row shifts of a frame transfer", "528", _shifts(Settings(1))[0],
               note="counted in the sequence, clock by clock", by="component"),
        number("003 abstract", "quantum efficiency, at the most", "93",
               100 * pixels.responsivity / photons, "%", note=f"at {chip.WAVELENGTH:g} nm",
               by="formula"),
        number("003 §1", "bits of a value", "16", int(np.max(full)).bit_length(), "bit",
               note="of the largest value of a simulated frame", by="component"),
        number("003 §0", "effective output noise", "1",
               EmccdPixels(gain=200.0).effective_read_noise, "e", relation="<",
               note=f"{pixels.read_noise:g} e at the output (assumed) over the gain of figure 4, "
               "200; from a gain of 30 on", by="formula"),
    ]  # fmt: skip


def _gain() -> list[PrintedRow]:
    """The gain, from the word on the wires of the potentiometer over the simulated loop."""
    voltage, drive = HighVoltage(), SineDrive()
    wipers = [_wiper(code) for code in range(1 << 8)]
    last = len(set(wipers)) - 1
    ends = [float(drive.course(128, wipers[n], 20_000)[-1, 1]) for n in (0, -1)]
    gains = [voltage.gain_at(drive.at_transfer(volts)) for volts in ends]
    other = HighVoltage(peak=SUMMARY_PEAK)
    steps = [HighVoltage(p).step_for(200.0) for p in (TEXT_PEAK, SUMMARY_PEAK)]
    return [
        number("003 §2", "steps of gain", "256", last + 1,
               note="wiper positions that the words over SPI reach", by="component"),
        listed("003 §2", "peak of the high-voltage clock at the first and last step", [37, 45],
               [round(v, 6) for v in ends], "V",
               note="of the simulated loop at rest; the text's range, which is used",
               by="component"),
        number("003 §3", "peak at the last step, as the summary has it", "50", ends[1], "V",
               proof=TEXT_PEAK[1] != SUMMARY_PEAK[1] and round(other.volts(last), 9) == 50
               and abs(other.gain(last) / voltage.gain(last) - 1) < 1e-9,
               note="the document contradicts itself: 45 V in its text, 50 V in its summary; the "
               "text's is used, where the circuit stands. The gains by step are the same either "
               f"way: 200 is step {steps[0]} and {steps[1]}", by="component"),
        number("003 §2", "gain at the first step", "1", gains[0], by="component"),
        number("003 §2", "gain at the last step", "1000", gains[1], by="component"),
        number("003 fig. 4", "gain of figure 4c", "200", drive.gain(_wiper(steps[0])),
               note=f"at the nearest step, {steps[0]}; a step there is "
               f"{100 * (voltage.gain(steps[0] + 1) / voltage.gain(steps[0]) - 1):.1f} %",
               by="component"),
        *_loop(drive, last),
        *_supplies(),
    ]  # fmt: skip


def _wiper(code: int) -> int:
    """Wiper of the potentiometer after the word of a code."""
    potentiometer = Potentiometer()
    for _, signal, value in word_edges(0, code):
        potentiometer.change(signal, value)
    return potentiometer.wiper


def _loop(drive: SineDrive, last: int) -> list[PrintedRow]:
    """The closed loop of the high voltage: how fast, and how far from a drift."""
    settings, (low, top) = drive.settings, TEXT_PEAK
    within = 0.01 / drive.voltage.slope(top)
    expected = settings.response * math.log((top - low) / within)
    settled = drive.settled(0, last, 0.01) or math.inf
    weak = SineDrive(celsius=75.0)
    x = weak.strength - 1.0
    rest = top * x / (1.0 + settings.loop_gain * (1.0 + x))
    error = float(weak.course(last, last, 20_000)[-1, 1]) - top
    return [
        unprinted("003 §2", "closed loop: time from 37 to 45 V, until the gain is within 1 %",
                  settled * 1e6, "us", holds=math.isclose(settled, expected, rel_tol=0.06),
                  note=f"simulated crest by crest; t ln(8 V/{within * 1e3:.1f} mV) of a first "
                  f"order of {settings.response * 1e6:g} us (assumed) is {expected * 1e6:.0f} us",
                  by="component"),
        unprinted("003 §2", "stable output: error of the peak with a transformer 10 % weaker",
                  error * 1e3, "mV", holds=math.isclose(error, rest, rel_tol=1e-6),
                  note=f"V x/(1 + L(1 + x)), L = {settings.loop_gain:g} (assumed); without the "
                  f"loop {top * x:.1f} V", by="component"),
    ]  # fmt: skip


def _supplies() -> list[PrintedRow]:
    supplies = Supplies()
    course = supplies.run(off=supplies.switch_time + 1e-3)
    good = course.good or math.inf
    safe = course.dark is not None and not breaches(course)
    return [
        unprinted("003 §1", "safe order of the supplies: time until all are good", good * 1e3, "ms",
                  holds=safe and math.isclose(good, supplies.switch_time),
                  note="up and down no tick breaks an interlock; the sum of delays and ramps; the "
                  "document prints no order, so rails, delays and ramps are assumed",
                  by="component"),
    ]  # fmt: skip


def _rows() -> list[PrintedRow]:
    """The window, and the row that the document omits."""
    timing = Timing()
    rows = []
    for source, first, count, printed in (
        ("003 fig. 5a", 0, 256, "256"), ("003 fig. 5b", 100, 128, "128"),
    ):  # fmt: skip
        cycle = Cycle(0, 0, timing, Settings(200, first, count).within(timing))
        rows.append(number(
            source, f"rows {first + 1} to {first + count} of the window", printed, _read(cycle),
            "rows", note=f"counted in the sequence; {cycle.before} dumped before, {cycle.after} "
            "after", by="component",
        ))  # fmt: skip
    whole = [Settings(200, 0, k).within(timing).rows for k in (0, 1, 512, 600)]
    cycle = Cycle(0, 0, timing, Settings(200, 100, 128).within(timing))
    before, read = cycle.before, cycle.settings.rows
    printed_after = after_printed(before, read)
    left = timing.rows - before - read
    dumped = _shifts(Settings(1, before, read))[1]
    rows += [
        listed("003 §2", "least and most rows of a window", [1, 512], [whole[0], whole[-1]],
               "rows", by="component"),
        number("003 §2", "rows dumped after the window of figure 5b, 527 - M - N",
               str(printed_after), cycle.after, "rows",
               proof=left == cycle.after == printed_after + 1 and dumped == timing.rows
               and before + read + printed_after == timing.rows - 1,
               note=f"the document's error: M + K + (527 - M - K) is 527 of {timing.rows} rows, "
               f"and its N is the K of its next page; 528 - M - K is used: {dumped} rows leave "
               "the store in the clock-by-clock sequence", by="component"),
    ]  # fmt: skip
    return rows


def _read(cycle: Cycle) -> int:
    """Number of rows that the sequence reads, from its edges."""
    line = cycle.timing.shift + cycle.timing.line
    return int(np.count_nonzero(np.diff(cycle.leaving()) >= line)) + 1


def _small() -> Timing:
    """A chip of 528 rows with short lines, so that a cycle can be simulated clock by clock."""
    return Timing(columns=4, line=6, transfer=2, shift=2, dump=2, clear=1)


def _shifts(settings: Settings) -> tuple[int, int]:
    """Number of rows that move from the image in the second transfer, and that leave the store
    after it, counted clock by clock."""
    small = _small()
    sequencer = CounterSequencer(small, settings)
    moved, left, high = 0, 0, 0
    for _ in range(frame_clocks(small, settings)):
        signals = sequencer.tick()
        leaving = signals["phase"] in (Phase.DUMP_BEFORE, Phase.READOUT, Phase.DUMP_AFTER)
        edge = signals["store_clock"] and not high
        moved += edge and signals["phase"] == Phase.SECOND_TRANSFER
        left += edge and leaving
        high = signals["store_clock"]
    return moved, left


def _overflow(columns: int = 42, gain: float = 200.0, lit: int = 256) -> list[PrintedRow]:
    """Figure 4c: the right half of the image is lit so that its excess fills the head of the next
    line."""
    electrons = electrons_to_fill(columns, lit, gain)
    charge = np.zeros((4, chip.COLUMNS))
    end = chip.COLUMNS - chip.DARK_COLUMNS
    charge[:, end - lit : end] = electrons * gain * (1 + 1e-9)
    spill_lines(charge)
    white = columns_filled(charge[2])
    return [
        number("003 fig. 4", "columns at the head that turn white at a gain of 200", "42", white,
               "columns", note=f"{electrons:.0f} e a pixel on {lit} columns, chosen for these "
               "columns, as the light is not printed: its closed form, spilled", by="formula"),
    ]  # fmt: skip


def _frame() -> list[PrintedRow]:
    """The frame time and Table 2; the formula and the table are lost."""
    timing = Timing()
    small, settings = _small(), Settings(1, 100, 128)
    sequencer = CounterSequencer(small, settings)
    clocks = 0
    while sequencer.cycles < 2:
        sequencer.tick()
        clocks += 1
    counted = clocks - 1
    table = window_table(timing)
    return [
        number("003 eq. of T_frame", "clocks of a cycle, closed form over counted clock by clock",
               "1", frame_clocks(small, settings) / counted,
               note="the formula is lost; ours follows from the sequence that the text tells",
               by="component"),
        unprinted("003 table 2", "frames a second at 2 ms with " + ", ".join(
            str(rows) for rows, _ in table) + " rows", [round(rate, 2) for _, rate in table],
            "1/s", holds=all(
                math.isclose(rate, timing.clock_hz / _clocks(timing, rows)) for rows, rate in table
            ), note="the table is lost; ours at a pixel clock of 10 MHz, which is assumed",
                  by="component"),
    ]  # fmt: skip


def _clocks(timing: Timing, rows: int) -> int:
    """Clocks of a cycle with a centred window, from the edges of the sequence."""
    first = (timing.image_rows - rows) // 2
    cycle = Cycle(0, 0, timing, Settings(200, first, rows).within(timing))
    return cycle.end - cycle.start


def _cold() -> list[PrintedRow]:
    run = run_cooling(Cooler(lambda _: 298.15), 900.0)
    last = float(run.chip[-1]) - chip.ZERO_CELSIUS
    return [number("003 §1", "temperature that the cooling loop holds", "-10", last, "degC",
                   note="900 s after it was switched on in air of 25 degC",
                   by="component")]  # fmt: skip
