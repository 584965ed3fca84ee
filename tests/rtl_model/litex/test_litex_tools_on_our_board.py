"""LiteX's own, unmodified litex_server, litex_cli and RemoteClient on our Verilog behind a pty.

VIFORM_LITEX_PYTHON=/path/to/python pytest -m slow -s tests/rtl_model/litex
"""

import re
import socket
import subprocess
import time
from pathlib import Path

import pytest

from rtl_model.geometry import Geometry
from rtl_model.registers import MAGIC, csr_csv
from rtl_model.virtual import VirtualBoard

SIZE = Geometry(rows=4, columns=32, clock_hz=2_000_000, capture_words=256)

CLIENT = """
import sys, time
from litex.tools.litex_client import RemoteClient
bus = RemoteClient(port=int(sys.argv[1]), csr_csv=sys.argv[2])
bus.open()
magic, before = bus.regs.ctrl_magic.read(), bus.regs.ctrl_scratch.read()
bus.regs.ctrl_scratch.write(0xCAFE0123)
after = bus.regs.ctrl_scratch.read()
base = bus.mems.pattern_mem.base
words = [0x01010101 * n for n in range(20)]
bus.write(base, words)
same = bus.read(base, 20) == words
fifo = bus.read(bus.regs.prbs_source.addr, 2, burst="fixed")
begun = time.monotonic()
for _ in range(200):
    assert bus.regs.ctrl_magic.read() == magic
rate = 200 / (time.monotonic() - begun)
print(hex(magic), hex(before), hex(after), same, len(set(fifo)), bus.regs.uart_writes.read(), rate)
bus.close()
"""


def free_port():
    with socket.socket() as held:
        held.bind(("localhost", 0))
        return held.getsockname()[1]


def await_server(server, port):
    for _ in range(200):
        assert server.poll() is None, "litex_server ended"
        with socket.socket() as probe:
            if probe.connect_ex(("localhost", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("litex_server did not listen")


@pytest.mark.slow
@pytest.mark.parametrize("level", ["bytes", "pins", "model"])
def test_litex_server_cli_and_remote_client(litex_python, verilator, tmp_path, level):
    tools = Path(litex_python).parent
    csr = tmp_path / "csr.csv"
    csr.write_text(csr_csv(SIZE))
    port = free_port()

    def cli(*given):
        command = [str(tools / "litex_cli"), "--port", str(port), "--csr-csv", str(csr), *given]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        return done.stdout

    with VirtualBoard(SIZE, level=level) as board:
        command = [str(tools / "litex_server"), "--uart", "--uart-port", str(board.port)]
        command += ["--uart-baudrate", str(SIZE.baud), "--bind-port", str(port)]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as server:
            try:
                await_server(server, port)
                assert "Viform spike board 4x32" in cli("--ident")
                listed = cli("--regs")
                assert re.search(rf"0x{MAGIC:08x}\s+ctrl_magic", listed)
                assert re.search(r"0x12345678\s+ctrl_scratch", listed)
                assert len(re.findall(r"0x[0-9a-f]+ : 0x", listed)) > 50
                assert f"0x{MAGIC:08x}" in cli("--read", "0x0")
                cli("--write", "ctrl_scratch", "0x55aa1234")
                assert "0x55aa1234" in cli("--read", "ctrl_scratch")
                client = subprocess.run(
                    [litex_python, "-c", CLIENT, str(port), str(csr)],
                    capture_output=True,
                    text=True,
                    timeout=120,
                )
                assert client.returncode == 0, client.stderr
                said = client.stdout.split()
                assert said[:6] == [hex(MAGIC), "0x55aa1234", "0xcafe0123", "True", "2", "22"]
                print(f"\nLiteX's RemoteClient at level {level}: {float(said[6]):.0f} reads/s")
            finally:
                server.terminate()
                server.wait(10)
