"""Our host on LiteX's own, unmodified UARTBone: its Verilog at pin level behind a pty.

VIFORM_LITEX_PYTHON=/path/to/python pytest -m slow -s tests/rtl_model/litex
"""

import subprocess
import time
from pathlib import Path

import pytest

from rtl_model.host import (
    Board,
    Cause,
    LineFault,
    LineLog,
    ReplayPort,
    Uartbone,
    open_port,
    read_csr,
)

HERE = Path(__file__).parent
CLOCK_HZ, BAUD = 2_000_000, 115_200
SLOWER = 3.0  # than life, at most, on a busy machine


@pytest.fixture(scope="module")
def design(litex_python, verilator, tmp_path_factory):
    """A folder with LiteX's csr.csv and the verilated design."""
    folder = tmp_path_factory.mktemp("soc")
    command = [litex_python, str(HERE / "make_soc.py"), str(folder), str(CLOCK_HZ), str(BAUD)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    command = [verilator, "--cc", "--exe", "--build", "-O3", "-Wno-fatal", "-CFLAGS", "-O2"]
    command += ["-LDFLAGS", "-lutil", "--top-module", "soc", "--Mdir", "obj", "-o", "pty_board"]
    command += ["soc.v", str(HERE / "pty_board.cpp")]
    subprocess.run(command, check=True, capture_output=True, timeout=300, cwd=folder)
    return folder


@pytest.fixture
def board(design):
    command = [str(design / "obj" / "pty_board"), str(CLOCK_HZ), str(BAUD)]
    with subprocess.Popen(
        command, cwd=design, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as running:
        port = open_port(running.stdout.readline().strip(), BAUD)
        yield Board(Uartbone(port, time_scale=SLOWER), read_csr(design / "csr.csv"))
        port.close()
        running.stdin.close()
        assert running.wait(10) == 0


@pytest.mark.slow
def test_registers_identifier_and_memory_of_a_foreign_design(board):
    assert not board.csr.is_viform_board and not board.verify
    assert board.identifier() == "LiteX behind its own UARTBone"
    assert board.read("ctrl_scratch") == 0x12345678
    assert board.read("wide_value") == 0x0123456789ABCDEF
    board.write("wide_value", 0xDEADBEEF00C0FFEE)
    assert board.read("wide_copy") == 0xDEADBEEF00C0FFEE
    base = board.csr.base("ram")
    words = [n * 2654435761 & 0xFFFFFFFF for n in range(1024)]
    begun = time.monotonic()
    board.bone.write(base, words)
    assert board.bone.read(base, 1024) == words
    passed = time.monotonic() - begun
    board.bone.write(base + 8, [1, 2, 3], fixed=True)
    assert board.bone.read(base, 4) == [words[0], words[1], 3, words[3]]
    assert board.bone.read(base + 8, 5, fixed=True) == [3] * 5
    begun = time.monotonic()
    for _ in range(500):
        assert board.read("ctrl_scratch") == 0x12345678
    print(
        f"\n{8192 / passed / 1000:.1f} kB/s, {500 / (time.monotonic() - begun):.0f} round trips/s"
    )
    assert board.bone.strays == board.bone.retried == 0


@pytest.mark.slow
@pytest.mark.parametrize("cut", [1, 2, 5, 7, 13])
def test_a_write_cut_short_is_forgotten_after_silence(board, cut):
    base = board.csr.base("ram")
    board.bone.write(base, [10, 20])
    whole = bytes([1, 2]) + (base // 4).to_bytes(4, "big") + bytes(8)
    board.bone.port.write(whole[:cut])
    with pytest.raises(LineFault) as fault:  # its request is taken as the rest of the write
        for _ in range(4):
            board.read("ctrl_scratch")
    assert fault.value.cause in (Cause.SILENT, Cause.SHORT)
    assert board.read("ctrl_scratch") == 0x12345678


@pytest.mark.slow
def test_our_words_per_transaction_stay_under_its_watchdog_and_255_do_not(board):
    """LiteX's watchdog is 100 ms over the whole transaction: 255 words at 115 200 baud are cut."""
    assert len(board.bone.read(board.csr.base("ram"), 600)) == 600
    port = board.bone.port
    port.write(bytes([2, 255]) + (board.csr.base("ram") // 4).to_bytes(4, "big"))
    got = port.read(4 * 255, 2.0)
    assert 1000 < len(got) + 6 < 1160  # 1152 bytes in 100 ms
    board.bone.resynchronise()
    assert board.read("ctrl_scratch") == 0x12345678


@pytest.mark.slow
def test_its_log_replays_without_it(board, tmp_path):
    def session(bone):
        other = Board(bone, board.csr)
        return other.identifier(), other.read("wide_copy"), bone.read(other.csr.base("ram"), 300)

    with LineLog(tmp_path / "log", board.bone.port) as log:
        live = session(Uartbone(board.bone.port, time_scale=SLOWER, log=log))
    replay = ReplayPort(tmp_path / "log")
    assert session(Uartbone(replay)) == live
    assert replay.finished
