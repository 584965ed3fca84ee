"""The host over UDP: exact through a proxy that loses, repeats and reorders; faults by name."""

import socket
import threading
from contextlib import contextmanager

import numpy as np
import pytest

from cosim import InputError
from rtl_model.cycle import Settings, planes
from rtl_model.host import Board, Cause, LineFault, capture, opened_bone, pattern, prbs
from rtl_model.host.ether import count_losses, most_words, udp_address
from rtl_model.host.ether.udp import UdpAddress
from rtl_model.registers import MAGIC, MEMORIES, REGISTERS
from rtl_model.virtual.ethernet import EthernetBoard
from tests.rtl_model.ether.conftest import SIZE
from tests.rtl_model.ether.lossy_proxy import LossyProxy

ADDRESS = {entry.name: entry.address for entry in (*REGISTERS, *MEMORIES)}
PATTERN, WRITES = ADDRESS["pattern_mem"], ADDRESS["write_mem"]


@contextmanager
def through(board, kind=LossyProxy, **shares):
    """A proxy before the board, and a host of it."""
    with kind(("127.0.0.1", udp_address(board.port).port), **shares) as proxy:  # noqa: SIM117
        with opened_bone(proxy.url, 1, simulated=True) as (bone, _):
            yield proxy, bone


def test_registers_by_name(bone):
    board = Board(bone)
    assert board.info().geometry == SIZE
    board.write("ctrl_scratch", 0xDEADBEEF)
    assert board.read("ctrl_scratch") == 0xDEADBEEF
    assert board.identifier() == "Viform spike board 4x40"
    for retry in (False, True):
        assert bone.read(ADDRESS["ctrl_scratch"], 3, fixed=True, retry=retry) == [0xDEADBEEF] * 3


def test_a_write_is_done_once_though_its_packets_are_lost_and_repeated(board):
    """Words for the sink's queue: one too many or too few would stay in its counters."""
    with through(board, seed=5, loss=0.2, repeat=0.2, reorder=0.2) as (proxy, bone):
        registers = Board(bone)
        bone.words_at_once = 8  # packets of three words
        bone.exchange.least_wait_s = 2e-3
        registers.write("sink_clear", 1)
        words = list(range(1, 61))
        bone.write(ADDRESS["sink_data"], words, fixed=True)
        assert registers.read("sink_level") == 60
        assert registers.read("sink_lost") == 0
        image = [n * 0x01010101 for n in range(40)]
        bone.write(PATTERN, image)
        assert bone.read(PATTERN, 40) == image
        assert min(*proxy.lost.values(), *proxy.repeated.values()) > 0
        registers.write("sink_clear", 1)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_captures_are_exact_through_a_lossy_network(board, seed):
    with through(board, seed=seed, loss=0.05, repeat=0.05, reorder=0.05) as (proxy, bone):
        bone.words_at_once = 16
        bone.exchange.least_wait_s = 2e-3
        registers = Board(bone)
        image = np.random.default_rng(seed).integers(256, size=(4, 40))
        pattern.upload(registers, image)
        settings = {"sensor_threshold": 0, "sensor_pattern": 0, "sensor_reset_rule": 0}
        for name, value in settings.items():
            registers.write(name, value)
        for _ in range(3):
            captured = capture.burst(registers, 20, clear=True)
            expected = planes(SIZE, Settings.from_registers(captured.settings, 0), image, 20)
            assert captured.planes.any() and (captured.planes == expected).all()
            assert captured.lost == captured.retries == 0
        bone.exchange.settle(0.1)
        counts = bone.exchange.counts
        assert counts.lost > 0 and counts.repeated > 0
        # Each datagram that the proxy lost or repeated is counted, in whatever direction.
        assert counts.lost + counts.late >= sum(proxy.lost.values())
        assert counts.lost <= sum(proxy.lost.values())


def test_prbs_through_a_lossy_network(board):
    with through(board, seed=4, loss=0.1, repeat=0.1, reorder=0.05) as (_, bone):
        bone.words_at_once = 16
        bone.patience_s = bone.exchange.patience_s = 0.05
        report = prbs.check(Board(bone), 31, 200)
    assert report.bits_wrong_from_board == report.bits_wrong_to_board == 0
    assert report.words_lost_to_board == 0 and report.faults > 0


def test_losses_are_counted_by_direction(board):
    with through(board, seed=7, loss=0.05, repeat=0, reorder=0) as (proxy, bone):
        bone.exchange.least_wait_s = 5e-3
        bone.read(0)
        before = dict(proxy.lost)
        found = count_losses(bone, 300)
    lost = {way: proxy.lost[way] - before[way] for way in before}
    assert found.counts.sent == 300
    assert lost["to"] > 0 and lost["from"] > 0
    # The readings of the counter before and after may lose a packet of their own.
    assert -lost["to"] <= found.to_board < 0 and -lost["from"] <= found.from_board < 0
    assert found.counts.lost == -found.to_board - found.from_board


class ShortBuffer(LossyProxy):
    """A network that drops long datagrams."""

    longest = 100

    def _send(self, way, data):
        if len(data) <= self.longest:
            super()._send(way, data)


def test_the_longest_packets_are_found(board, monkeypatch):
    monkeypatch.setattr("rtl_model.host.ether.exchange._DOUBTFUL_WAIT_S", 5e-3)
    with through(board, ShortBuffer, loss=0, repeat=0, reorder=0) as (_, bone):
        bone.exchange.least_wait_s = 5e-3
        bone.read(0)
        assert most_words(bone) == (100 - 16) // 4  # two heads and an address besides the words


@pytest.mark.slow
def test_a_long_read_falls_back_to_short_packets(board):
    with through(board, ShortBuffer, loss=0, repeat=0, reorder=0) as (_, bone):
        bone.write(PATTERN, [7, 8, 9])
        bone.exchange.patience_s = 0.05
        assert bone.read(PATTERN, 40)[:3] == [7, 8, 9]
        assert bone.words_at_once < 22


def test_a_restart_is_told():
    with EthernetBoard("udp:127.0.0.1:0", SIZE, level="model") as first:
        place = udp_address(first.port)
        with opened_bone(first.port, 1, simulated=True) as (bone, _):
            for value in range(3):
                bone.write(ADDRESS["ctrl_scratch"], value)
            first.stop()
            with EthernetBoard(place.url, SIZE, level="model"):
                with pytest.raises(LineFault) as told:
                    bone.write(ADDRESS["ctrl_scratch"], 9)
                assert told.value.cause is Cause.RESTARTED
                bone.write(ADDRESS["ctrl_scratch"], 10)
                assert bone.read(ADDRESS["ctrl_scratch"]) == [10]


def test_another_program_that_writes_is_told(board, bone):
    bone.write(ADDRESS["ctrl_scratch"], 1)
    with opened_bone(board.port, 1, simulated=True) as (other, _):
        for value in range(3):
            other.write(ADDRESS["ctrl_scratch"], value)
    with pytest.raises(LineFault, match="end the other program"):
        bone.write(ADDRESS["ctrl_scratch"], 2)


def test_another_design_is_written_plainly_and_confirmed():
    """Without `write_mem`: a packet that writes and reads the same address."""
    other = EthernetBoard("udp:127.0.0.1:0", SIZE, level="model", faults=["foreign"])
    with other, opened_bone(other.port, 1, simulated=True) as (bone, _):
        bone.write(ADDRESS["ctrl_scratch"], 77)
        assert bone.read(ADDRESS["ctrl_scratch"]) == [77]
        assert bone.read(WRITES, 2) == [0, 0]


def answering(reply):
    """A socket that answers every datagram with what `reply` returns; yields its URL."""
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", 0))

    def run():
        while True:
            data, sender = udp.recvfrom(65536)
            if data == b"end":
                return
            for each in reply(data):
                udp.sendto(each, sender)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return udp, f"udp:127.0.0.1:{udp.getsockname()[1]}", thread


def test_another_program_at_the_port_is_no_board(monkeypatch):
    monkeypatch.setattr("rtl_model.host.ether.etherbone._PROBE_WAIT_S", 0.01)
    udp, url, thread = answering(lambda data: [b"hello", b"\x4e\x6f\x10\x44" + bytes(40), b""])
    refused = pytest.raises(InputError, match="must be the address of a board that answers")
    with refused, opened_bone(url, 1) as (bone, _):
        raise AssertionError(bone)
    udp.sendto(b"end", udp.getsockname())
    thread.join()
    udp.close()


@pytest.mark.parametrize(
    ("url", "host", "port"),
    [
        ("udp:board", "board", 1234),
        ("udp:192.168.1.50:99", "192.168.1.50", 99),
        ("UDP:[::1]", "::1", 1234),
        ("udp://[fe80::1]:5", "fe80::1", 5),
    ],
)
def test_names_of_boards(url, host, port):
    assert udp_address(url) == UdpAddress(host, port)


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("udp:", "must be udp:HOST or"),
        ("udp:a b", "must be udp:HOST or"),
        ("udp:board:", "a number from 1 to 65535, not ''"),
        ("udp:board:abc", "a number from 1 to 65535, not 'abc'"),
        ("udp:board:0", "not '0'"),
        ("udp:board:65536", "not '65536'"),
        ("udp:[::1", "must be udp:HOST or"),
        ("udp:::1", "must be udp:HOST or"),
    ],
)
def test_a_wrong_name_is_one_line(url, says):
    with pytest.raises(InputError) as refused:
        udp_address(url)
    assert says in str(refused.value) and "\n" not in str(refused.value)


def test_a_port_in_use_is_refused(board):
    with pytest.raises(InputError, match="one that is in use"):
        EthernetBoard(board.port, SIZE, level="model").start()
    with pytest.raises(InputError, match="an address of this machine"):
        EthernetBoard("udp:192.0.2.1", SIZE, level="model").start()


def test_no_magic_is_taken_from_nowhere(bone):
    assert bone.read(0) == [MAGIC]
    with pytest.raises(InputError, match="words below"):
        bone.read(2)
