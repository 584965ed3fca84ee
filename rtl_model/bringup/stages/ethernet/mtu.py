"""Stage mtu: finds the longest packets that the board answers."""

from __future__ import annotations

from rtl_model.bringup.bench.bench import UdpBench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host.ether import AROUND, most_words

_MOST = 255  # words of an Etherbone record
_LEAST = AROUND + 1  # a numbered write of one word
_HEADS = 28 + 16  # bytes of a packet besides its words: IPv4 and UDP, Etherbone and one address


def check_mtu(bench: UdpBench) -> Figures:
    """Finds the most words that one packet can read and write; later stages use it.

    Raises StageFault mtu if not even one word can be written.
    """
    words = most_words(bench.bone)
    figures: Figures = {
        "words": words, "packet_bytes": _HEADS + 4 * words, "words_written": max(0, words - AROUND),
    }  # fmt: skip
    remedy = "raise etherbone_buffer_depth of the design to 256, or the MTU of the network"
    if words < _LEAST:
        raise StageFault(
            "mtu", f"packets of more than {words} words are not answered", remedy, figures
        )
    bench.bone.words_at_once = words
    if words < _MOST:
        figures["note"] = f"longer packets are not answered: {remedy}"
    return figures
