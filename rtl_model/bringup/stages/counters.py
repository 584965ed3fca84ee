"""Stage counters: the board must count exactly the bytes and words that were sent."""

from __future__ import annotations

import zlib

import numpy as np

from rtl_model.bringup.bench.bench import SerialBench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host.ports import latency_timer

ERRORS = ("uart_framing_errors", "uart_watchdog_aborts", "uart_unknown_commands")
_ROUND_TRIPS = 64
_LATENCY_S = 4e-3  # beyond line time; a larger one is caused by an adapter's timer
_SCRATCH_RESET = 0x12345678
_REMEDIES = {
    "uart_framing_errors": "check levels, ground and baud: stop bits were low",
    "uart_watchdog_aborts": "the board waited 100 ms for bytes of a request, which were lost, "
    "delayed, or shifted by an added one: check cable, flow control and baud",
    "uart_unknown_commands": "bytes to the board were lost, added or changed: check cable and baud",
}


def check_counters(bench: SerialBench) -> Figures:
    """Writes and reads `ctrl_scratch` in round trips, then writes a burst of words back to back.

    Raises StageFault with the counter's name if a counter differs, "scratch" if a word was changed,
    "restarted" if the board restarted, "clock" if its uptime does not advance.
    """
    scratch = bench.read_stable("ctrl_scratch")
    counted = tuple(bench.bone.read_twice(bench.address("uart_writes"), 2))
    before = {name: bench.read_stable(name) for name in ERRORS}
    bytes_before, sent_before = bench.read("uart_rx_bytes"), bench.bone.bytes_sent
    uptime = bench.read("ctrl_uptime")
    written: list[int] = []
    random = np.random.Generator(np.random.Philox(1))
    times = []
    wrong: str | None = None
    got_first = 0
    for _ in range(_ROUND_TRIPS):
        value = int(random.integers(1 << 32))
        begun = bench.port.now()
        bench.write("ctrl_scratch", value)
        got = bench.read_expecting("ctrl_scratch", value)
        times.append(bench.port.now() - begun)
        written.append(value)
        if got not in (value, _SCRATCH_RESET) and bench.monitor is not None:
            bench.write("ctrl_scratch", value)
            written.append(value)
            if bench.read_expecting("ctrl_scratch", value) == value:
                bench.monitor.count_misplaced()
                continue
        if got != value and wrong is None:
            got_first = got
            wrong = f"ctrl_scratch was written {value:#010x} and read {got:#010x}"
    row = [int(word) for word in random.integers(1 << 32, size=bench.bone.words_at_once)]
    bench.bone.write(bench.address("ctrl_scratch"), row, fixed=True)
    written += row
    figures = _speed(bench, times)
    figures["words_written"] = len(written)
    for name, value in before.items():
        after = bench.read_stable(name)
        figures[name.removeprefix("uart_")] = after - value
        if after > value:
            raise StageFault(
                name.removeprefix("uart_").replace("_", "-"),
                f"{name} grew by {after - value} over {len(written)} words",
                _REMEDIES[name],
                figures,
            )
        if after < value:
            raise _restarted(name, value, after, figures)
    if wrong is not None and got_first == _SCRATCH_RESET:
        raise StageFault(
            "restarted",
            f"the board restarted meanwhile: {wrong}, its value after reset",
            "check its supply and its reset",
            figures,
        )
    if wrong is not None:
        raise StageFault("scratch", wrong, "check cable, ground, levels and baud", figures)
    _check_written(bench, written, counted, figures)
    _check_bytes(bench, bytes_before, sent_before, figures)
    later = bench.read("ctrl_uptime")
    if later == uptime:
        raise StageFault(
            "clock", "ctrl_uptime stands still", "check the reset of the counter", figures
        )
    bench.write("ctrl_scratch", scratch)
    return figures


def _speed(bench: SerialBench, times: list[float]) -> Figures:
    """Figures: round trips per second, and the latency beyond the time on the line."""
    typical = float(np.median(times))
    line = bench.line_s(20)  # ten bytes to write a word, six to ask for it, four of answer
    latency = max(0.0, typical - line * bench.bone.time_scale)
    figures: Figures = {
        "round_trips": len(times),
        "round_trips_per_s": len(times) / max(sum(times), 1e-9),
        "latency_ms": 1e3 * latency,
        "line_ms": 1e3 * line,
    }
    timer, held_ms = latency_timer(bench.port.name)
    if held_ms is not None:
        figures["latency_timer_ms"] = held_ms
    if latency > _LATENCY_S and not bench.simulated:
        figures["note"] = f"answers are delayed by {1e3 * latency:.1f} ms beyond the line: " + (
            "the connection causes the delay and has no latency timer to set"
            if held_ms is None
            else "give --low-latency, or set the adapter's latency timer to 1 ms "
            f"(`echo 1 | sudo tee {timer}`)"
        )
    return figures


def _restarted(name: str, before: int, after: int, figures: Figures) -> StageFault:
    return StageFault(
        "restarted",
        f"the board restarted meanwhile: {name} fell from {before} to {after}",
        "check its supply and its reset",
        figures,
    )


def _check_written(
    bench: SerialBench, written: list[int], before: tuple[int, ...], figures: Figures
) -> None:
    """Compares count and CRC-32 of the written words with the board's.

    Args:
        bench: the board under test.
        written: words written.
        before: the board's count and CRC-32 before.
        figures: figures of the stage, for a fault.
    """
    count, crc = bench.bone.read_twice(bench.address("uart_writes"), 2)
    count = (count - before[0]) & 0xFFFFFFFF
    expected_crc = zlib.crc32(b"".join(word.to_bytes(4, "big") for word in written), before[1])
    if count < len(written):
        raise StageFault(
            "words-lost",
            f"the board received {count} of {len(written)} words; it probably misses words that "
            "arrive back to back"
            if count
            else "the board received no word",
            "check that the receiver is ready for a start bit in the middle of the stop bit",
            figures,
        )
    if count > len(written) or crc != expected_crc:
        raise StageFault(
            "words-changed",
            f"the board received {count} words with CRC-32 {crc:#010x}, {len(written)} with "
            f"{expected_crc:#010x} were sent",
            "check cable, ground, levels and baud",
            figures,
        )


def _check_bytes(bench: SerialBench, before: int, sent_before: int, figures: Figures) -> None:
    """Compares the board's count of bytes with the host's. A reading counts its own request."""
    arrived = (bench.read("uart_rx_bytes") - before) & 0xFFFFFFFF  # it may have overflowed
    sent = bench.bone.bytes_sent - sent_before
    figures |= {"bytes_sent": sent, "bytes_counted": arrived}
    if arrived < sent:
        raise StageFault(
            "bytes-lost",
            f"the board counted {arrived} of {sent} bytes",
            "check cable and flow control, and that the receiver accepts bytes back to back",
            figures,
        )
    if arrived > sent:
        raise StageFault(
            "bytes-added",
            f"the board counted {arrived} bytes where {sent} were sent",
            "check the line for noise, and that no other program writes to the port",
            figures,
        )
