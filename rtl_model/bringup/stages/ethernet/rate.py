"""Stage rate: payload per second in both directions, with many packets in flight."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rtl_model.bringup.bench.bench import UdpBench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host.ether import AROUND

__all__ = ["check_rate"]

_SECONDS = 0.5  # of each direction
_PACKETS = 64  # of the first measurement, then as many as take the time
_MOST_PACKETS = 1 << 15


def check_rate(bench: UdpBench) -> Figures:
    """Reads and writes the pattern memory again and again; every word is compared.

    The previous contents are restored. Raises StageFault words for a wrong word.
    """
    bone = bench.bone
    base, words = bench.csr.base("pattern_mem"), bench.geometry.pattern_bytes // 4
    bench.write("sensor_run", 0)
    previous = bone.read_words(base, words).tobytes()
    random = np.random.Generator(np.random.Philox(1))
    image = random.integers(1 << 32, size=words, dtype=np.uint32).astype(">u4").tobytes()
    sent, asked = min(words, bone.words_at_once - AROUND), min(words, bone.words_at_once)
    places = (base + 4 * np.arange(asked, dtype=np.int64)).astype(">u4").tobytes()
    wrong = 0

    def read(packets: int) -> None:
        nonlocal wrong
        wrong += sum(got != image[: 4 * asked] for got in bone.read_blocks([places] * packets))

    try:
        written = _measured(bench, lambda n: bone.write_blocks([(base, image[: 4 * sent])] * n))
        bone.write_words(base, image)
        received = _measured(bench, read)
    finally:
        bone.write_words(base, previous)
    figures: Figures = {
        "read_bits_per_s": 32 * asked * received, "write_bits_per_s": 32 * sent * written,
        "packets_in_flight": int(bone.exchange.window),
    }  # fmt: skip
    if wrong:
        raise StageFault(
            "words", f"{wrong} packets with wrong words of the pattern memory at full rate",
            "check the timing of the design's bus and memories", figures,
        )  # fmt: skip
    return figures


def _measured(bench: UdpBench, act: Callable[[int], None]) -> float:
    """Packets per second of `act`, which exchanges a number of packets."""
    count = _PACKETS
    while True:
        begun = bench.port.now()
        act(count)
        spent = bench.port.now() - begun
        if spent >= _SECONDS / 2 or count >= _MOST_PACKETS:
            return count / max(spent, 1e-9)
        count = min(_MOST_PACKETS, max(2 * count, int(count * _SECONDS / max(spent, 1e-3))))
