"""Etherbone packets: those of LiteX, a round trip, and bytes that are none."""

import random

import numpy as np
import pytest

from rtl_model.geometry import Geometry
from rtl_model.host.ether import Malformed, parse
from rtl_model.host.ether.packet import answer_packet, answered, probe, record_packet
from rtl_model.registers import MAGIC, VERSION
from rtl_model.virtual.ethernet import answer, make_bus
from rtl_model.virtual.faults import Faults

# Made by litex 2024.12, litex/tools/remote/etherbone.py, as its CommUDP sends them: a read of the
# words at 0, 4 and 8 with return address 7, a write of two words at 4, and a probe.
LITEX_READ = "4e6f104400000000000f000300000007000000000000000400000008"
LITEX_WRITE = "4e6f104400000000000f020000000004cafe012389abcdef"
LITEX_PROBE = "4e6f11440000000000000000"


@pytest.fixture
def bus():
    return make_bus("model", Geometry(rows=2, columns=32, clock_hz=4_000_000), Faults())


def big(*words):
    return np.array(words, ">u4").tobytes()


def test_our_packets_are_those_of_litex():
    assert record_packet(7, big(0, 4, 8)).hex() == LITEX_READ
    written = record_packet(0, write_address=4, written=big(0xCAFE0123, 0x89ABCDEF))
    assert written.hex() == LITEX_WRITE
    assert probe(0).hex() == LITEX_PROBE


def test_the_board_answers_litex_as_liteeth_does(bus):
    reply = answer(bytes.fromhex(LITEX_READ), bus)
    assert answered(reply) == (7, big(MAGIC, 0x12345678, VERSION))
    assert reply.hex().startswith("4e6f104400000000000f030000000007")
    assert answer(bytes.fromhex(LITEX_WRITE), bus) is None
    assert answered(answer(record_packet(1, big(4)), bus)) == (1, big(0xCAFE0123))
    assert answer(bytes.fromhex(LITEX_PROBE), bus).hex() == "4e6f12440000000000000000"


def test_a_packet_of_several_records_writes_before_it_reads(bus):
    head = record_packet(0)[:8]
    first = record_packet(5, big(4), 4, big(11))[8:]
    second = record_packet(6, big(0, 4), 4, big(12))[8:]
    packet = parse(answer(head + first + second, bus))
    assert [record.write_address for record in packet.records] == [5, 6]
    assert [record.written.tolist() for record in packet.records] == [[11], [MAGIC, 12]]


def test_a_round_trip_of_random_records():
    r = random.Random(3)
    for _ in range(200):
        written, reads = (
            big(*(r.getrandbits(32) for _ in range(r.choice((0, 1, 7, 255))))) for _ in "wr"
        )
        tag, address = r.getrandbits(32), r.getrandbits(32)
        (record,) = parse(record_packet(tag, reads, address, written)).records
        assert record.written.tobytes() == written and record.reads.tobytes() == reads
        assert not written or record.write_address == address
        assert not reads or record.return_address == tag


@pytest.mark.parametrize(
    ("packet", "says"),
    [
        ("", "0 bytes"),
        ("4e6f1044", "shorter than its head"),
        ("4e6e104400000000", "magic 0x4e6e, not 0x4e6f"),
        ("4e6f204400000000", "version 2"),
        ("4e6f108400000000", "widths 0x84"),
        ("4e6f1044000000000f", "1 bytes after the last record"),
        ("4e6f104400000000000f00ff", "0 writes and 255 reads in a packet of 12 bytes"),
    ],
)
def test_bytes_that_are_no_packet_are_told_in_one_line(packet, says):
    with pytest.raises(Malformed) as refused:
        parse(bytes.fromhex(packet))
    assert says in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 2))])
def test_any_bytes_are_parsed_or_refused_on_both_sides(seed, bus):
    r = random.Random(seed)
    seeds = [bytes.fromhex(text) for text in (LITEX_READ, LITEX_WRITE, LITEX_PROBE)]
    seeds += [
        answer_packet([(1, big(1, 2))]),
        record_packet(9, big(0x50000000), 0x50000000, big(0, 0x100000, 1, 5)),
    ]
    refused = 0
    for _ in range(1000):
        data = bytearray(r.choice(seeds))
        for _ in range(r.randrange(4)):
            place = r.randrange(len(data) + 1)
            if r.random() < 0.5:
                data[place:place] = r.randbytes(r.choice((1, 3, 4, 300)))
            elif place < len(data):
                data[place] = r.randrange(256)
            if r.random() < 0.2:
                del data[place:]
        data = r.randbytes(r.randrange(40)) if r.random() < 0.1 else bytes(data)
        try:
            parse(data)
        except Malformed as exc:
            refused += 1
            assert "\n" not in str(exc)
            assert answer(data, bus) is None
        else:
            reply = answer(data, bus)
            assert reply is None or parse(reply)
        answered(data)
    assert refused > 50
    # Whatever was written, the board still answers.
    assert answered(answer(record_packet(3, big(0)), bus)) == (3, big(MAGIC))
