"""The stages of a board with Ethernet, which exist over UDP only: link, loss, mtu and rate."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cosim.config.amounts import number
from rtl_model.bringup.bench.bench import UdpBench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host import Cause, LineFault
from rtl_model.host.ether import WRITE_OVERHEAD, Etherbone, count_losses, most_words

_PROBES = 4
_READS = 64  # one after another, of one word
_SENT = 512
_MOST_LOST = 0.1
"""Largest share of lost packets: then half of all windows of seven packets have a loss."""
_MOST_WORDS = 255  # words of an Etherbone record
_LEAST = WRITE_OVERHEAD + 1  # a numbered write of one word
_HEADS = 28 + 16  # bytes of a packet besides its words: IPv4 and UDP, Etherbone and one address
_SECONDS = 0.5  # of each direction
_PACKETS = 64  # of the first measurement, then as many as take the time
_MOST_PACKETS = 1 << 17


def check_link(bench: UdpBench) -> Figures:
    """Sends probes, which the network core answers, and reads, which the design's bus answers.

    Raises LineFault silent, or garbled if what arrives is no Etherbone; StageFault bus if probes
    are answered and reads are not, garbled if one register gives several values.
    """
    probes = [bench.bone.probe() for _ in range(_PROBES)]
    address = bench.address("ctrl_magic") if bench.csr.is_viform_board else 0
    times, words = [], []
    try:
        for _ in range(_READS):
            begun = bench.port.now()
            words.append(bench.bone.read(address)[0])
            times.append(bench.port.now() - begun)
    except LineFault as fault:
        if fault.cause is not Cause.SILENT:
            raise
        raise StageFault(
            "bus", f"probes are answered by {bench.port.name}, but reads are not",
            "the network works: check the design behind Etherbone, its clock and its reset",
        ) from fault  # fmt: skip
    if len(set(words)) > 1:
        values = ", ".join(f"{word:#010x}" for word in dict.fromkeys(words))
        raise StageFault(
            "garbled", f"one register read {_READS} times gives {values}",
            "check the design's bus, and that no other board has this IP address",
        )  # fmt: skip
    bench.magic = words[0]
    typical = float(np.median(times))
    return {
        "answers": len(words), "probe_ms": 1e3 * min(probes), "round_trip_ms": 1e3 * typical,
        "round_trips_per_s": 1 / max(typical, 1e-9),
    }  # fmt: skip


def check_loss(bench: UdpBench) -> Figures:
    """Sends packets without repeating any, and compares the counts at both ends.

    Raises StageFault version for a board without numbered writes, loss if more than 10 % are lost.
    """
    if "write_mem" not in bench.csr.memories:
        raise StageFault(
            "version", "the design has no numbered writes (write_mem)",
            "load a board of this program's version",
        )  # fmt: skip
    counts, to_board, from_board = count_losses(bench.bone, _SENT)
    share = counts.lost / max(1, counts.sent)
    figures: Figures = {
        "packets": counts.sent, "packets_lost": counts.lost, "loss_percent": 100 * share,
        "packets_late": counts.late, "packets_repeated": counts.repeated,
        "packets_reordered": counts.reordered, "to_board": to_board, "from_board": from_board,
    }  # fmt: skip
    text = _text(counts.lost, counts.sent, to_board, from_board)
    if share > _MOST_LOST:
        raise StageFault(
            "loss", text, "check cable, switch and duplex, and the load of the network", figures
        )
    others = [
        f"{count} {what}"
        for count, what in (
            (counts.repeated, "repeated"), (counts.reordered, "reordered"), (counts.late, "late"),
        )
        if count
    ]  # fmt: skip
    if counts.lost or others:
        figures["note"] = "; ".join([text, ", ".join(others)] if others else [text])
    return figures


def _text(lost: int, sent: int, to_board: int, from_board: int) -> str:
    if not lost:
        return "no packet is lost"
    ways = [
        f"{-net} net {way} the board" for net, way in ((to_board, "to"), (from_board, "from"))
        if net < 0
    ]  # fmt: skip
    where = f" ({', '.join(ways)})" if ways else ""
    return f"{lost} of {sent} packets are lost, {number(100 * lost / sent, 2)} %{where}"


def check_mtu(bench: UdpBench) -> Figures:
    """Finds the most words that one packet can read and write; later stages use it.

    Raises StageFault mtu if not even one word can be written.
    """
    words = most_words(bench.bone)
    figures: Figures = {
        "words": words, "packet_bytes": _HEADS + 4 * words,
        "words_written": max(0, words - WRITE_OVERHEAD),
    }  # fmt: skip
    remedy = "raise etherbone_buffer_depth of the design to 256, or the MTU of the network"
    if words < _LEAST:
        raise StageFault(
            "mtu", f"packets of more than {words} words are not answered", remedy, figures
        )
    bench.bone.words_at_once = words
    if words < _MOST_WORDS:
        figures["note"] = f"longer packets are not answered: {remedy}"
    return figures


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
    sent, asked = min(words, bone.words_at_once - WRITE_OVERHEAD), min(words, bone.words_at_once)
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
