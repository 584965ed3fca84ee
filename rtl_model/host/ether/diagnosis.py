"""Measurements of the network to a board: losses in each direction, and the longest packets."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from rtl_model.host.ether.etherbone import WRITE_MEM, WRITE_OVERHEAD, Etherbone
from rtl_model.host.ether.exchange import Counts, is_answered
from rtl_model.host.ether.packet import MOST_WORDS, record_packet

_BACK = WRITE_MEM.to_bytes(4, "big")
_SETTLE = 0.1  # share of the patience after which no late answer is expected
_WORD = 1 << 32


class Losses(NamedTuple):
    """What became of packets that were not repeated.

    Attributes:
        counts: counts of the packets.
        to_board, from_board: net packets added (lost, if negative) in that direction.
    """

    counts: Counts
    to_board: int
    from_board: int


def count_losses(bone: Etherbone, packets: int) -> Losses:
    """Sends packets without repeating any.

    They are numbered writes whose number has been passed, which the board counts and refuses.

    Args:
        bone: Etherbone of a Viform board.
        packets: number of packets.
    """
    exchange = bone.exchange
    exchange.settle(_SETTLE * bone.patience_s)
    number, arrived = map(int, bone.read_words(WRITE_MEM, 2))
    packet = _refused(number, 0)
    exchange.settle(_SETTLE * bone.patience_s)
    before = replace(exchange.counts)
    exchange.begin()
    left = packets
    while left or exchange.flying:
        while left and exchange.flying < max(1, int(exchange.window)):
            exchange.send(left, packet)
            left -= 1
        exchange.receive()
        exchange.overdue()
    exchange.settle(_SETTLE * bone.patience_s)
    counts = exchange.counts.since(before)
    now = (int(bone.read_words(WRITE_MEM, 2)[1]) - arrived) % _WORD
    return Losses(counts, now - packets, counts.answered + counts.repeated - now)


def most_words(bone: Etherbone) -> int:
    """Most words of a packet that the board answers, both as a read and as a write; 0 if none.

    A write has `WRITE_OVERHEAD` words of data less than a read. It has no effect, as in
    `count_losses`.
    """
    number = int(bone.read_words(WRITE_MEM, 1)[0])

    def fits(words: int) -> bool:
        data = max(0, words - WRITE_OVERHEAD)
        packets = partial(record_packet, reads=_BACK * words), _refused(number, data)
        return all(is_answered(bone.exchange, packet) for packet in packets)

    if fits(MOST_WORDS):
        return MOST_WORDS
    low, high = 0, MOST_WORDS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def _refused(number: int, data: int) -> partial[bytes]:
    """A numbered write of `data` words that the board refuses, as a packet for a tag."""
    head = np.array([(number - 1) % _WORD, 0, 0], ">u4").tobytes()
    return partial(
        record_packet, reads=_BACK, write_address=WRITE_MEM, written=head + bytes(4 * data)
    )
