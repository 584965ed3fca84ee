"""Stage timing: compares frame periods with the tick, and the board's clock with the host's."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

from cosim.config.amounts import number
from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.stage import Figures, StageFault

_SPAN_S = 1.0  # between the first and the last reading of the clock
_READINGS = 8  # at each end; the fastest is used
_DIFFERENCES = 6  # of frame clocks, for each setting
_PPM_MOST = 20_000.0  # assumed: every common oscillator is within 2 %, where a UART still works
_WORD = 1 << 32


class Reading(NamedTuple):
    """One reading of the board's clock counter.

    Attributes:
        clocks: count, modulo 2^32.
        earliest, latest: bounds of the host time at which it was taken, s.
    """

    clocks: int
    earliest: float
    latest: float


def check_timing(bench: Bench) -> Figures:
    """Differences of `sensor_frame_clock` must be whole ticks, for both clocks and a longer tick.

    It also measures the deviation of the board's clock, ppm, with its uncertainty.

    Raises StageFault stands-still, tick or clock.
    """
    size = bench.geometry
    bench.write("sensor_run", 0)
    figures: Figures = {"tick_clocks": size.tick_clocks}
    compared = 0
    for clocks, select in (
        (size.tick_clocks, 0), (size.tick_clocks, 1), (size.tick_clocks + 7, 0), (1, 0),
    ):  # fmt: skip
        bench.write("sensor_tick_clocks", clocks)
        bench.write("sensor_clock_select", select)
        compared += _ticks(bench, max(clocks, size.tick_minimum) << select, select)
    bench.write("sensor_tick_clocks", size.tick_clocks)
    bench.write("sensor_clock_select", 0)
    hz, doubt = clock_rate(bench)
    ppm, doubt_ppm = 1e6 * (hz / size.clock_hz - 1), 1e6 * doubt / size.clock_hz
    figures |= {"differences": compared, "clock_hz": hz, "clock_doubt_hz": doubt}
    if bench.simulated:
        figures["note"] = (
            f"simulated board: {number(hz, 4)} clocks per second of the host's time, "
            f"{hz / size.clock_hz:.3g} times real time; a real clock is not measured"
        )
        return figures
    figures |= {
        "clock_error_ppm": ppm,
        "clock_doubt_ppm": doubt_ppm,
        "frame_hz": hz / max(size.tick_clocks, size.tick_minimum),
    }
    if abs(ppm) - doubt_ppm > _PPM_MOST:
        raise StageFault(
            "clock",
            f"the board's clock runs at {hz:,.0f} Hz, {ppm:+.0f} ppm (uncertainty "
            f"{doubt_ppm:.0f} ppm) from the {size.clock_hz:,} Hz that it was built for",
            "give the build the oscillator's real frequency, or check the PLL",
            figures,
        )
    return figures


def _ticks(bench: Bench, period: int, select: int) -> int:
    """Compares differences of frame clocks with whole periods; returns their number."""
    before = bench.read_stable("sensor_frame_clock")
    bench.write("sensor_run", 1)
    limit = bench.limit(2.0 + 100 * bench.ticks_s(1, select))
    starts: list[int] = []  # of frames that began under these settings
    while len(starts) <= _DIFFERENCES:
        now = bench.read("sensor_frame_clock")
        if now != (starts[-1] if starts else before):
            starts.append(now)
        elif limit.left() <= 0:
            bench.write("sensor_run", 0)
            raise StageFault(
                "stands-still",
                f"{len(starts)} frames began, not {_DIFFERENCES + 1}",
                "check the scan's counter and the pixel clock",
            )
        bench.bone.pause(bench.ticks_s(1, select))
    bench.write("sensor_run", 0)
    for one, other in pairwise(starts):
        passed = (other - one) % _WORD
        if passed % period:
            raise StageFault(
                "tick",
                f"two frames began {passed} clocks apart, which is {passed / period:.4f} ticks of "
                f"{period} clocks",
                "check sensor_tick_clocks, sensor_clock_select and the scan's counter",
                {"period": period, "passed": passed},
            )
    return _DIFFERENCES


def clock_rate(bench: Bench, span_s: float = _SPAN_S) -> tuple[float, float]:
    """The board's clock by the host's time, and its uncertainty, Hz.

    The count is read at an unknown time between the end of the request and the first byte of the
    answer.
    """
    first = _read(bench)
    bench.bone.pause(span_s)
    last = _read(bench)
    count = (last.clocks - first.clocks) % _WORD
    longest, shortest = last.latest - first.earliest, max(last.earliest - first.latest, 1e-9)
    low, high = count / max(longest, 1e-9), count / shortest
    return (low + high) / 2, (high - low) / 2


def _read(bench: Bench) -> Reading:
    """The reading with the tightest bounds among several."""
    best: Reading | None = None
    scale = bench.bone.time_scale
    for _ in range(_READINGS):
        begun = bench.port.now()
        count = bench.read("ctrl_uptime")
        ended = bench.port.now()
        # A real line takes the time of six bytes before and four bytes after the reading.
        spare = 0.9 * scale
        earliest, latest = begun + spare * bench.line_s(6), ended - spare * bench.line_s(4)
        if bench.simulated or earliest >= latest:
            earliest, latest = begun, ended
        if best is None or latest - earliest < best.latest - best.earliest:
            best = Reading(count, earliest, latest)
    assert best is not None
    return best
