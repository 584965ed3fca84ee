"""What a board answers to an Etherbone packet, as LiteEth does."""

from __future__ import annotations

from rtl_model.host.ether import Malformed, answer_packet, parse, probe_reply
from rtl_model.virtual.ethernet.bus import Bus


def answer(data: bytes, bus: Bus) -> bytes | None:
    """Performs a packet and returns its answer; None if it has none.

    Of each record the writes are performed before the reads. Bytes that are no Etherbone packet,
    and replies, are dropped.
    """
    try:
        packet = parse(data)
    except Malformed:
        return None
    if packet.reply:
        return None
    if packet.probe:
        return probe_reply(packet.rest)
    answers = []
    for record in packet.records:
        if record.written.size:
            bus.write(record.write_address, record.written.tobytes())
        if record.reads.size:
            answers.append((record.return_address, bus.read(record.reads)))
    return answer_packet(answers) if answers else None
