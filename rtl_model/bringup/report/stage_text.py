"""One-line summary of a stage: its main figures with their units."""

from __future__ import annotations

from cosim.config.amounts import amount, number
from rtl_model.bringup.bench.stage import Stage

_VERILOG = {
    None: "",
    True: ", this program's Verilog",
    False: ", other Verilog than this program's",
}


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
