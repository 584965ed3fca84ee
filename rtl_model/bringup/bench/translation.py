"""Detection of bytes that something between host and board translates.

Terminal settings, flow control, telnet servers and 7-bit lines change certain bytes and no others.
Each leaves a signature: which byte is lost, doubled or replaced. The probe writes a word with one
such byte to `ctrl_scratch` and reads it again. An answer of another length is caused on the way
from the board. An unchanged register is caused on the way to it, because the board waits for the
missing byte. A single replaced byte does not show its direction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from rtl_model.bringup.bench.bench import SerialBench
from rtl_model.bringup.bench.deadline import OutOfTime
from rtl_model.bringup.bench.stage import StageFault
from rtl_model.host import LineFault

_LF, _CR, _XON, _XOFF, _ALL_ONES, _HIGH = 0x0A, 0x0D, 0x11, 0x13, 0xFF, 0xB3
_NEUTRAL: Final = bytes((0x5A, 0x35, 0x5A, 0x35))
"""A word that no known translation changes."""
_RAW: Final = "set the port to raw mode (`stty -F PORT raw`), also on a server that it is behind"


class _Signature(NamedTuple):
    """A known translation.

    Attributes:
        byte: byte that is probed.
        change: what the byte becomes.
        text: the observation, followed by the direction.
        remedy: what to do.
    """

    byte: int
    change: Callable[[int], bytes]
    text: str
    remedy: str


_KNOWN: Final = (
    _Signature(
        _HIGH, lambda byte: bytes((byte & 0x7F,)), "bit 7 of every byte is 0 {way}: the line has 7 "
        "data bits", "set the port, and a server that it is behind, to 8 data bits, no parity",
    ),
    _Signature(
        _XON, lambda byte: b"", "0x11 is lost {way}: software flow control (XON/XOFF) takes it",
        "turn software flow control off (`stty -F PORT -ixon -ixoff`), also on a server",
    ),
    _Signature(
        _XOFF, lambda byte: b"", "0x13 is lost {way}: software flow control (XON/XOFF) takes it",
        "turn software flow control off (`stty -F PORT -ixon -ixoff`), also on a server",
    ),
    _Signature(
        _ALL_ONES, lambda byte: bytes((byte, byte)), "0xff is doubled {way}, as by a telnet server "
        "or a terminal that marks errors (PARMRK)",
        "use rfc2217:// for a telnet server, or its raw TCP port",
    ),
    _Signature(
        _ALL_ONES, lambda byte: b"", "0xff is lost {way}, as by a telnet server",
        "use rfc2217:// for a telnet server, or its raw TCP port",
    ),
    _Signature(
        _LF, lambda byte: bytes((_CR, _LF)), "0x0a becomes 0x0d 0x0a {way}: line ends are "
        "translated", _RAW,
    ),
    _Signature(
        _LF, lambda byte: bytes((_CR,)), "0x0a becomes 0x0d {way}: line ends are translated", _RAW
    ),
    _Signature(
        _CR, lambda byte: bytes((_LF,)), "0x0d becomes 0x0a {way}: line ends are translated", _RAW
    ),
    _Signature(
        _CR, lambda byte: b"", "0x0d is lost {way}: line ends are translated", _RAW
    ),
)  # fmt: skip


def find_translation(bench: SerialBench) -> StageFault | None:
    """Fault "translated" if the line has the signature of a known translation.

    The scratch register of a Viform board is overwritten. Returns None if the line does not carry
    a neutral word either, or differs in another way.
    """
    try:
        if _probe(bench, _NEUTRAL) != _NEUTRAL:
            return None
        answers: dict[int, bytes] = {}
        for known in _KNOWN:
            word = bytes((_NEUTRAL[0], known.byte, *_NEUTRAL[2:]))
            if known.byte not in answers:
                answers[known.byte] = _probe(bench, word)
            way = _direction(word, known, answers[known.byte])
            if way is None or _probe(bench, word) != answers[known.byte]:
                continue
            return StageFault("translated", known.text.format(way=way), known.remedy)
    except (LineFault, OutOfTime):
        return None
    return None


def _direction(word: bytes, known: _Signature, answer: bytes) -> str | None:
    """Direction of a translation; None if the answer has another cause.

    Args:
        word: bytes written, after `_NEUTRAL` was written.
        known: the translation.
        answer: all bytes that came back.
    """

    def translated(data: bytes) -> bytes:
        return b"".join(known.change(b) if b == known.byte else bytes((b,)) for b in data)

    arrived = translated(word)
    on_board = arrived[:4] if len(arrived) >= 4 else _NEUTRAL
    if answer == word:
        return None
    if answer == arrived:
        return "from the board" if len(arrived) != 4 else "on the way to or from the board"
    if answer == on_board:
        return "to the board"
    return "in both directions" if answer == translated(on_board) else None


def _probe(bench: SerialBench, word: bytes) -> bytes:
    """Writes a neutral word, then a word, to `ctrl_scratch`; returns all bytes of the answer."""
    bone, address = bench.bone, bench.address("ctrl_scratch")
    for each in (_NEUTRAL, word):
        bone.write(address, int.from_bytes(each, "big"))
    bone.resynchronise()
    answer = bone.ask(address)
    bone.resynchronise()
    return answer
