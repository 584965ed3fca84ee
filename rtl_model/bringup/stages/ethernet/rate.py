"""Stage rate: payload per second in both directions, with many packets in flight."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rtl_model.bringup.bench.bench import UdpBench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host.ether import AROUND, Etherbone

_SECONDS = 0.5  # of each direction
_PACKETS = 64  # of the first measurement, then as many as take the time
_MOST_PACKETS = 1 << 17


class Rates(NamedTuple):
    """Payload per second over a network.

    Attributes:
        read, written: bit/s.
        read_words, written_words: words of payload in a packet.
        wrong: packets whose words were wrong.
    """

    read: float
    written: float
    read_words: int
    written_words: int
    wrong: int


def check_rate(bench: UdpBench) -> Figures:
    """Reads and writes the pattern memory again and again; every word is compared.

    The previous contents are restored. Raises StageFault words for a wrong word.
    """
    bench.write("sensor_run", 0)
    words = bench.geometry.pattern_bytes // 4
    rates = measured_rates(bench.bone, bench.csr.base("pattern_mem"), words, _SECONDS)
    figures: Figures = {
        "read_bits_per_s": rates.read, "write_bits_per_s": rates.written,
        "packets_in_flight": int(bench.bone.exchange.window),
    }  # fmt: skip
    if rates.wrong:
        raise StageFault(
            "words", f"{rates.wrong} packets with wrong words of the pattern memory at full rate",
            "check the timing of the design's bus and memories", figures,
        )  # fmt: skip
    return figures


def measured_rates(bone: Etherbone, base: int, words: int, seconds: float) -> Rates:
    """Writes and reads a memory in the longest packets; its contents are restored.

    Args:
        bone: Etherbone of the board.
        base: byte address of the memory.
        words: words of the memory.
        seconds: time of each direction, about, s.
    """
    previous = bone.read_words(base, words).tobytes()
    random = np.random.Generator(np.random.Philox(1))
    image = random.integers(1 << 32, size=words, dtype=np.uint32).astype(">u4").tobytes()
    sent, asked = min(words, bone.words_at_once - AROUND), min(words, bone.words_at_once)
    places = (base + 4 * np.arange(asked, dtype=np.int64)).astype(">u4").tobytes()
    wrong = 0

    def write(packets: int) -> None:
        bone.write_blocks([(base, image[: 4 * sent])] * packets)

    def read(packets: int) -> None:
        nonlocal wrong
        wrong += sum(got != image[: 4 * asked] for got in bone.read_blocks([places] * packets))

    try:
        written = _packets_per_s(bone, write, seconds)
        bone.write_words(base, image)
        received = _packets_per_s(bone, read, seconds)
    finally:
        bone.write_words(base, previous)
    return Rates(32 * asked * received, 32 * sent * written, asked, sent, wrong)


def _packets_per_s(bone: Etherbone, act: Callable[[int], None], seconds: float) -> float:
    """Packets per second of `act`, which exchanges a number of packets."""
    count = _PACKETS
    while True:
        begun = bone.port.now()
        act(count)
        spent = bone.port.now() - begun
        if spent >= seconds / 2 or count >= _MOST_PACKETS:
            return count / max(spent, 1e-9)
        count = min(_MOST_PACKETS, max(2 * count, int(count * seconds / max(spent, 1e-3))))
