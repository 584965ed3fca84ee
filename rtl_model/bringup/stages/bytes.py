"""Stage bytes: checks that answers arrive and are right. If not, it searches the board's baud."""

from __future__ import annotations

import math

from rtl_model.bringup.bench.bench import SerialBench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host import BaudReport, Cause, LineFault, find_baud
from rtl_model.host.baud import REACH_PERCENT, STANDARD_RATES
from rtl_model.host.uartbone import FINAL, PATIENCE_S
from rtl_model.registers import MAGIC

_READS = 8  # consecutive reads of one word; all must be complete
_LEAST_TEXT = 4  # consecutive printable bytes that count as text
_SHOWN = 40
_WORKS_PERCENT = 4.0  # deviation of the baud that every receiver accepts
_NARROW = 0.04  # a board answers over some 10 % of the nominal rate; less is noise by chance
_LISTEN_S = 0.05
_LATE_S = 5.0  # longest wait for a delayed answer, and so for the verdict on a silent board
_LATE_MARGIN = 1.5


def check_bytes(bench: SerialBench) -> Figures:
    """Reads one word several times. Answers must have the right length and be equal.

    Raises StageFault text, garbled, baud or slow; LineFault for the host's causes (silent, echo,
    short and others).
    """
    unsolicited = _listen(bench)
    if unsolicited:
        raise _unsolicited_bytes(bench, unsolicited)
    bench.bone.resynchronise()
    address = bench.address("ctrl_magic") if bench.csr.is_viform_board else 0
    begun = bench.port.now()
    try:
        words, times = [], []
        for _ in range(_READS):
            asked = bench.port.now()
            words.append(bench.bone.read(address, retry=False)[0])
            times.append(bench.port.now() - asked - bench.line_s(10))
    except LineFault as fault:
        if fault.cause in FINAL:
            raise
        heard = bench.port.heard
        if fault.cause in (Cause.SILENT, Cause.SHORT):
            slow = _slow(bench, address)
            if slow is not None:
                raise slow from fault
        text = readable(heard)
        if text is not None:
            raise _unsolicited_bytes(bench, heard) from fault
        raise _wrong_baud(bench, fault.text) or _spoilt(bench, fault) from fault
    spent = bench.port.now() - begun
    if len(set(words)) > 1 or (bench.csr.is_viform_board and words[0] != MAGIC):
        values = ", ".join(f"{word:#010x}" for word in dict.fromkeys(words))
        wrong = _wrong_baud(bench, f"answers have the right length and hold {values}")
        if wrong is not None:
            raise wrong
        if len(set(words)) > 1:
            raise StageFault(
                "garbled",
                f"one register read {_READS} times gives {values}",
                "check cable, ground, levels and baud",
            )
    if min(times) > _usual(bench):  # even the fastest, so the host is not merely busy
        raise _slow_fault(bench, min(times))
    bench.magic = words[0]
    return {"baud": bench.bone.baud, "answers": len(words), "s_per_answer": spent / len(words)}


def _slow(bench: SerialBench, address: int) -> StageFault | None:
    """The fault "slow" if the answer is right but delayed, else None."""
    delay = _delay(bench, address)
    if delay is None or delay <= _usual(bench):
        return None
    bench.bone.pause(_LATE_S)  # answers to earlier requests have ended by then
    delay = _delay(bench, address)
    return None if delay is None or delay <= _usual(bench) else _slow_fault(bench, delay)


def _usual(bench: SerialBench) -> float:
    """Usual delay of an answer beyond its time on the line, s."""
    return PATIENCE_S * max(1.0, bench.bone.time_scale)


def _slow_fault(bench: SerialBench, delay: float) -> StageFault:
    scale = math.ceil(_LATE_MARGIN * delay / PATIENCE_S)
    return StageFault(
        "slow",
        f"{bench.port.name} answers correctly, but {delay:.2f} s late, where {_usual(bench):.2g} s "
        "beyond the line's time are usual",
        f"give --time-scale {scale}, or find what delays the bytes (a simulator, a network, a hub)",
        {"late_s": delay, "usual_s": _usual(bench), "time_scale": scale},
    )


def _delay(bench: SerialBench, address: int) -> float | None:
    """Delay of an answer of our board beyond its time on the line, s; None without an answer."""
    bone = bench.bone
    usual, bone.patience_s = bone.patience_s, max(_LATE_S, 4 * bone.patience_s)
    begun = bench.port.now()
    try:
        word = bone.read(address, retry=False)[0]
    except LineFault as fault:
        if fault.cause in FINAL:
            raise
        return None
    finally:
        bone.patience_s = usual
    right = word == MAGIC if bench.csr.is_viform_board else True
    return max(0.0, bench.port.now() - begun - bench.line_s(10)) if right else None


def readable(data: bytes) -> str | None:
    """The text in `data` if it looks like text of another device, else None."""
    fine = sum(32 <= byte < 127 or byte in (9, 10, 13) for byte in data)
    if len(data) < _LEAST_TEXT or fine < 0.9 * len(data) or b"SPK2" in data:
        return None
    return " ".join(data.decode("ascii", "replace").split())[:_SHOWN] or None


def _listen(bench: SerialBench) -> bytes:
    """Bytes that arrive without a request."""
    bench.port.drain()
    got = bench.port.read(1, _LISTEN_S)  # one byte, which a replayed log treats as waiting
    return got + bench.port.read(63, _LISTEN_S) if got else b""


def _unsolicited_bytes(bench: SerialBench, data: bytes) -> StageFault:
    text = readable(data)
    if text is not None:
        return StageFault(
            "text",
            f"{bench.port.name} sends text: {text!r}",
            "that is another device or a console on this line: name the board's port",
            {"heard": text},
        )
    return StageFault(
        "garbled",
        f"{bench.port.name} sends bytes without a request ({data[:8].hex(' ')})",
        "check what sends there, its baud, and that RX does not float",
        {"heard": data[:_SHOWN].hex()},
    )


def _wrong_baud(bench: SerialBench, observation: str) -> StageFault | None:
    """The fault "baud" if the board answers at another rate, else None."""
    nominal = bench.nominal_baud
    bench.note(
        "no valid answer arrives: looking for the board's baud, first near "
        f"{_spaced(nominal)}, then at standard rates, which may take a minute"
    )
    try:
        result = find_baud(
            bench.port, nominal, time_scale=bench.bone.time_scale, log=bench.bone.log
        )
    except LineFault as fault:
        if fault.cause is not Cause.SILENT:
            raise
        return None
    finally:
        bench.bone.set_baud(nominal)
    narrow = result.highest - result.lowest < _NARROW * result.measured
    if result.tolerable or narrow or abs(result.error_percent) <= _WORKS_PERCENT:
        return None
    text = f"{observation}; {_baud_text(result)}"
    return StageFault("baud", text, _remedy(result), _figures(result))


def _spoilt(bench: SerialBench, fault: LineFault) -> LineFault:
    """The first fault, with the number of complete answers in further reads.

    A silent or interrupted line gives none, a noisy one some.
    """
    complete, heard = 0, False
    for _ in range(_READS):
        try:
            bench.bone.read(0, retry=False)
            complete += 1
        except LineFault as again:
            if again.cause in FINAL:
                raise
            heard = heard or again.cause is not Cause.SILENT
    if not complete and not heard:
        return fault
    cause = Cause.SHORT if fault.cause is Cause.SILENT else fault.cause
    return LineFault(
        cause,
        f"{fault.text}; of {_READS} more answers at {_spaced(bench.bone.baud)} baud {complete} "
        f"were complete: bytes are lost or changed {'sometimes' if complete else 'always'}",
        "check cable, ground, levels and noise on the line",
    )


def _baud_text(result: BaudReport) -> str:
    if abs(result.error_percent) > REACH_PERCENT:
        return (
            f"the board answers at {_spaced(_standard(result))} baud, and the host sends at "
            f"{_spaced(result.nominal)}"
        )
    side, fast = ("above", "slow") if result.error_percent > 0 else ("below", "fast")
    host = 100 * (result.nominal / result.measured - 1)
    return (
        f"the board answers at {_spaced(result.measured)} baud, {abs(result.error_percent):.1f} % "
        f"{side} {_spaced(result.nominal)} (+-{max(0.1, result.uncertainty_percent):.1f} %): the "
        f"host is {abs(host):.1f} % too {fast} for it"
    )


def _spaced(rate: int) -> str:
    return f"{rate:,}".replace(",", " ")


def _standard(result: BaudReport) -> int:
    """The standard rate nearest to the measured one if both work together, else the measured."""
    rate = min(STANDARD_RATES, key=lambda rate: abs(rate - result.measured))
    near = abs(rate / result.measured - 1) <= _WORKS_PERCENT / 100
    return rate if near else result.measured


def _remedy(result: BaudReport) -> str:
    if abs(result.error_percent) > REACH_PERCENT:
        return f"give --baud {_standard(result)}"
    return (
        f"give --baud {result.measured}, or correct the board's clock or its divider "
        "(receivers accept up to 5 %)"
    )


def _figures(result: BaudReport) -> Figures:
    return {
        "baud_nominal": result.nominal,
        "baud_measured": result.measured,
        "baud_error_percent": result.error_percent,
        "baud_uncertainty_percent": result.uncertainty_percent,
        "host_error_percent": round(100 * (result.nominal / result.measured - 1), 2),
        "by_pulse": result.by_pulse,
        "answers_from": result.lowest,
        "answers_to": result.highest,
    }
