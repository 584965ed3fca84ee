"""Throughput of the digital side of the chip: a board over UDP on this machine, the host here and
the cycle model of the default board in a process of its own; and the row scan, from words of pixels
to raw bytes with markers, against the output of the chip at 40 kHz.

The ceiling of the board is datagrams of the same sizes between two such processes without board and
protocol: the other one returns an answer for each that arrives.
"""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Final

import numpy as np

from cosim.compute.forks import python_child
from cosim.compute.opencl import Device
from cosim.files.raw import FRAME_BYTES, RAW_SIZE
from cosim.run.timing import TimingRow, least_of
from cosim.spikes.viform import WORD
from rtl_model.bringup.stages.ethernet import measured_rates
from rtl_model.geometry import Geometry
from rtl_model.host import default_map
from rtl_model.host.bone import patience_s
from rtl_model.host.ether import Etherbone, answer_packet, open_udp, record_packet
from rtl_model.readout import BIT_RATE, Readout, read_in_numpy

_WORDS: Final = 8
"""Number of words per pixel in a call: 32 MB of spikes, more than the cache."""
_PLAIN_CYCLES: Final = 8
_TURNS: Final = 5
AIM: Final = 100e6
"""Real time: Ethernet of 100 Mbit/s, whose payload is less, bit/s."""
SECONDS: Final = 3.0
"""Duration of each measurement, about, s."""
_FLYING: Final = 64
"""Datagrams in flight for the ceiling."""
_LOST_S: Final = 0.1
"""Wait after which those in flight are taken as lost."""
_BOARD: Final = """
import sys
from rtl_model.virtual.ethernet import EthernetBoard
with EthernetBoard("udp:127.0.0.1:0", level="model") as board:
    print(board.port, flush=True)
    sys.stdin.read()
"""
_ANSWERS: Final = """
import signal, socket, sys
signal.alarm(60)
answer, udp = bytes(int(sys.argv[1])), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
udp.bind(("127.0.0.1", 0))
print(udp.getsockname()[1], flush=True)
while True:
    udp.sendto(answer, udp.recvfrom(65536)[1])
"""


def readout_row(device: Device, ceiling: float | None) -> TimingRow:
    """The row `sensor.readout`. The plain implementation unpacks and packs the bits in numpy.

    Args:
        device: OpenCL device.
        ceiling: measured ceiling, pixel-cycles/s, None if unknown.
    """
    random = np.random.default_rng(1)
    words = random.integers(0, 1 << 32, (_WORDS, *RAW_SIZE[::-1]), dtype=np.uint32)
    cycles = _WORDS * WORD
    readout = Readout(device)
    raw = readout.read(words, cycles)
    spent, plain_spent = least_of(
        [lambda: readout.read(words, cycles, raw), lambda: read_in_numpy(words[:1], _PLAIN_CYCLES)],
        _TURNS,
    )
    value = cycles * FRAME_BYTES * 8 / spent
    share = cycles * RAW_SIZE[0] * RAW_SIZE[1] / spent / ceiling if ceiling else None
    plain = _PLAIN_CYCLES * FRAME_BYTES * 8 / plain_spent
    return TimingRow(
        "sensor.readout", "exact", value, "bit/s", value / BIT_RATE, share, value / plain
    )


def board_rows(device: Device | None, ceiling: float | None) -> list[TimingRow]:
    """The rows `board.read` and `board.write`: payload per second. Every word read is compared.

    Args:
        device, ceiling: device and ceiling, not used; these rows have ceilings of their own.
    """
    base, words = default_map().base("pattern_mem"), Geometry().pattern_bytes // 4
    with _child(_BOARD) as port, closing(open_udp(port)) as udp:
        bone = Etherbone(udp, patience_s=patience_s(True, 1.0))
        rates = measured_rates(bone, base, words, SECONDS)
    if rates.wrong:
        raise RuntimeError(f"{rates.wrong} packets with wrong words of the pattern memory")
    reads = len(record_packet(0, bytes(4 * rates.read_words)))
    writes = len(record_packet(0, bytes(4), 0, bytes(4 * (3 + rates.written_words))))
    most_read = _datagrams_per_s(reads, len(answer_packet([(0, bytes(4 * rates.read_words))])))
    most_written = _datagrams_per_s(writes, len(answer_packet([(0, bytes(4))])))
    return [
        _row("board.read", rates.read, 32 * rates.read_words * most_read),
        _row("board.write", rates.written, 32 * rates.written_words * most_written),
    ]


def _row(name: str, value: float, ceiling: float) -> TimingRow:
    return TimingRow(name, "UDP, cycle model", value, "bit/s", value / AIM, value / ceiling, None)


def _datagrams_per_s(size: int, answer: int) -> float:
    """Datagrams of `size` bytes per second, each answered by one of `answer` bytes."""
    data, count = bytes(size), 0
    with (
        _child(_ANSWERS, str(answer)) as port,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp,
    ):
        udp.connect(("127.0.0.1", int(port)))
        udp.settimeout(_LOST_S)
        begun = time.perf_counter()
        flying = 0
        while (spent := time.perf_counter() - begun) < SECONDS:
            while flying < _FLYING:
                udp.send(data)
                flying += 1
            try:
                udp.recv(answer)
            except TimeoutError:
                flying = 0
                continue
            flying -= 1
            count += 1
    return count / spent


@contextmanager
def _child(code: str, *words: str) -> Iterator[str]:
    """A Python process that runs `code`; yields the first line that it prints."""
    process = subprocess.Popen(
        python_child(code, *words),
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8", errors="replace",
        start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.kill()  # it holds nothing; an interrupt of this program does not reach it
        process.communicate()
