"""A whole stream through a stream code, for measurements."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cosim import SpikeStream, Viform
from cosim.spikes.viform import WORD, words_for
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.decoder import StreamDecoder
from sensor.codec.packets.encoder import StreamEncoder
from sensor.codec.packets.packet import Packet


def to_packets(stream: SpikeStream, code: StreamCode) -> list[Packet]:
    """All packets of a stream."""
    encoder, step, packets = StreamEncoder(code, stream.shape), code.cycles // WORD, []
    total = words_for(stream.cycles)
    for first in range(0, total, step):
        words = stream.read_words(first, min(first + step, total))
        cycles = min(WORD * len(words), stream.cycles - WORD * first)
        packets += encoder.encode(words, WORD * first, cycles)
    return packets + encoder.flush()


def from_packets(packets: Iterable[Packet], stream: SpikeStream, code: StreamCode) -> Viform:
    """What a decoder of some of a stream's packets has."""
    decoder = StreamDecoder(code, stream.shape)
    for packet in packets:
        decoder.take(packet.to_bytes())
    words = np.concatenate(
        [
            decoder.read(min(first + code.cycles, stream.cycles)).words
            for first in range(0, stream.cycles, code.cycles)
        ]
    )
    return Viform(words, stream.cycles, stream.clock, int(getattr(stream, "start", 0)))


def size_of(packets: Iterable[Packet], stream: SpikeStream) -> float:
    """Bits per pixel and cycle, headers included."""
    pixels = stream.shape[0] * stream.shape[1]
    return 8 * sum(packet.size for packet in packets) / (stream.cycles * pixels)
