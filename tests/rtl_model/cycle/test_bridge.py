"""The byte-level board: LiteX's uartbone with its undocumented behaviour (100 ms, length 0, ..)."""

import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtl_model.cycle import Bridge
from rtl_model.geometry import Geometry
from rtl_model.registers import MAGIC, REGISTERS

ADDRESS = {register.name: register.address for register in REGISTERS}
SMALL = Geometry(rows=2, columns=32, clock_hz=1_000_000)
LATE = SMALL.clock_hz // 10


def packet(command, length, address, data=()):
    words = b"".join(value.to_bytes(4, "big") for value in data)
    return bytes([command, length]) + (address // 4).to_bytes(4, "big") + words


class Host:
    """Feeds whole packets, one after the other's answer."""

    def __init__(self, **options):
        self.bridge = Bridge(SMALL, byte_clocks=1, **options)
        self.clock = 0

    def send(self, *parts):
        reply = self.bridge.feed(packet(*parts), self.clock)
        self.clock = max(self.bridge.system.clock + 2, *reply.clocks, 0) + 10
        return reply.data

    def read(self, name):
        return int.from_bytes(self.send(2, 1, ADDRESS[name]), "big")


def test_the_example_of_the_wire():
    bridge = Bridge(SMALL)
    reply = bridge.feed(bytes.fromhex("020200000000"), 100)
    assert reply.data.hex() == "53504b3212345678"
    assert bridge.idle
    step = 10 * SMALL.bit_clocks
    first = 100 + 5 * step + 5  # five clocks after the request's last byte
    assert reply.clocks == [first + n * step for n in range(8)]


def test_increment_and_fixed_address():
    host = Host()
    assert host.send(1, 2, ADDRESS["sensor_pattern"], [2, 77]) == b""
    assert (host.read("sensor_pattern"), host.read("sensor_level")) == (2, 77)
    host.send(3, 3, ADDRESS["ctrl_scratch"], [1, 2, 3])
    assert host.read("ctrl_scratch") == 3
    assert host.read("ctrl_magic") == MAGIC
    fixed = host.send(4, 5, ADDRESS["ctrl_scratch"])
    assert fixed == bytes([0, 0, 0, 3]) * 5


def test_length_0_is_256_words():
    host = Host()
    assert len(host.send(4, 0, ADDRESS["ctrl_magic"])) == 1024
    assert host.send(3, 0, ADDRESS["ctrl_scratch"], range(256)) == b""
    assert host.bridge.idle and host.read("ctrl_scratch") == 255


def test_unknown_command_swallows_length_and_address():
    host = Host()
    assert host.send(0x55, 1, 0) == b""
    assert host.bridge.idle
    assert host.read("uart_unknown_commands") == 1


@pytest.mark.parametrize("missing", range(1, 14))
def test_a_cut_packet_is_forgotten_after_100_ms_and_its_whole_words_stand(missing):
    host = Host()
    whole = packet(1, 2, ADDRESS["sensor_pattern"], [1, 9])
    host.bridge.feed(whole[:-missing], 0)
    host.bridge.wait(LATE - 1)
    assert not host.bridge.idle
    host.bridge.wait(LATE)
    assert host.bridge.idle
    assert host.bridge.feed(b"\x02", LATE).data == b""  # comes with the cut and is lost
    host.clock = LATE + 1
    assert host.read("uart_watchdog_aborts") == 1
    assert host.read("sensor_pattern") == (1 if missing <= 4 else 0)
    assert host.read("sensor_level") == 0


def test_a_long_read_is_cut_where_real_gateware_cuts_it():
    """571 bytes of 150 words at 57 600 baud: measured with LiteX's gateware in Verilator."""
    bridge = Bridge(Geometry(rows=1, columns=1, clock_hz=57_600 * 16, baud=57_600))
    reply = bridge.feed(packet(4, 150, 0), 0)
    assert len(reply.data) == 571
    assert bridge.idle and bridge.system.line.watchdog_aborts == 1


def test_bytes_that_come_during_an_answer_are_counted_and_lost():
    bridge = Bridge(SMALL)
    reply = bridge.feed(packet(2, 2, 0) + packet(2, 1, 0), 0)
    assert len(reply.data) == 8 and bridge.system.line.rx_bytes == 12


def test_line_counters_and_their_clear():
    host = Host()
    host.send(1, 2, ADDRESS["ctrl_scratch"], [0xDEADBEEF, 7])  # the second to a read-only register
    assert host.read("uart_writes") == 2
    data = bytes.fromhex("deadbeef00000007")
    assert host.read("uart_writes_crc") == zlib.crc32(data)
    assert host.read("uart_rx_bytes") == 14 + 3 * 6
    assert host.read("uart_tx_bytes") == 3 * 4
    host.send(1, 1, ADDRESS["uart_clear"], [1])
    assert host.read("uart_writes") == host.read("uart_writes_crc") == 0
    assert host.read("uart_rx_bytes") == 3 * 6


def test_a_capture_drained_over_the_line_is_the_memory():
    host = Host()
    host.send(1, 1, ADDRESS["capture_arm"], [2])
    host.send(1, 1, ADDRESS["sensor_run"], [1])
    host.clock += 3 * SMALL.tick_clocks
    assert host.read("capture_state") == 4
    words = host.read("capture_level")
    assert words == 4 * SMALL.record_words
    drained = host.send(4, words, ADDRESS["capture_data"])
    sequences = [int.from_bytes(drained[16 * n : 16 * n + 4], "big") for n in range(4)]
    assert sequences == [0, 1, 2, 3]
    assert host.read("capture_level") == 0


VALID = st.builds(
    packet,
    st.integers(0, 5),
    st.integers(0, 3),
    st.sampled_from([*ADDRESS.values(), 0x800, 0x100000, 0x100040, 0xFFFFFFFC]),
    st.lists(st.integers(0, 0xFFFFFFFF), max_size=3),
)
TRAFFIC = st.lists(
    st.tuples(st.one_of(st.binary(max_size=20), VALID), st.integers(0, 3 * LATE)), max_size=12
)


@settings(max_examples=60, deadline=None)
@given(TRAFFIC)
def test_any_bytes_at_any_time_and_it_is_idle_after_100_ms_of_silence(traffic):
    bridge = Bridge(SMALL, byte_clocks=1)
    clock = sent = 0
    for data, gap in traffic:
        reply = bridge.feed(data, clock)
        sent += len(data)
        assert len(reply.data) == len(reply.clocks)
        assert reply.clocks == sorted(reply.clocks)
        clock += len(data) + gap
    clock = max(clock, bridge.system.clock) + LATE
    bridge.wait(clock)
    assert bridge.idle
    reply = bridge.feed(packet(2, 1, 0), clock + 1)
    assert reply.data == MAGIC.to_bytes(4, "big")
    assert bridge.system.line.rx_bytes <= sent + 6
