"""LiteX's own, unmodified Etherbone client reads and writes the virtual board over UDP.

VIFORM_LITEX_PYTHON=/path/to/python pytest -m slow -s tests/rtl_model/litex/test_litex_over_udp.py
"""

import subprocess

import pytest

from rtl_model.geometry import Geometry
from rtl_model.host import Board, opened_bone
from rtl_model.host.ether import udp_address
from rtl_model.registers import MAGIC, csr_csv
from rtl_model.virtual.ethernet import EthernetBoard

SIZE = Geometry(rows=4, columns=32, clock_hz=460_800, capture_words=256)

# The client binds the board's own port number, which is in use on this machine: it gets its socket
# from here, and everything else is LiteX's.
CLIENT = """
import socket, sys
from litex.tools.remote.comm_udp import CommUDP
comm = CommUDP(server="127.0.0.1", port=int(sys.argv[1]), csr_csv=sys.argv[2])
comm.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
comm.socket.settimeout(1.0)
assert comm.probe("127.0.0.1", int(sys.argv[1])) == 1
magic, before = comm.regs.ctrl_magic.read(), comm.regs.ctrl_scratch.read()
comm.regs.ctrl_scratch.write(0xCAFE0123)
after = comm.regs.ctrl_scratch.read()
base = comm.mems.pattern_mem.base
words = [0x01010101 * n for n in range(32)]
comm.write(base, words)
print(hex(magic), hex(before), hex(after), comm.read(base, 32) == words)
"""


@pytest.mark.slow
@pytest.mark.parametrize("level", ["model", "bytes"])
def test_litex_client_over_udp(litex_python, verilator, tmp_path, level):
    csr = tmp_path / "csr.csv"
    csr.write_text(csr_csv(SIZE))
    with EthernetBoard("udp:127.0.0.1:0", SIZE, level=level) as board:
        port = udp_address(board.port).port
        client = subprocess.run(
            [litex_python, "-c", CLIENT, str(port), str(csr)],
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
        assert client.returncode == 0, client.stderr
        assert client.stdout.split() == [hex(MAGIC), "0x12345678", "0xcafe0123", "True"]
        with opened_bone(board.port, 1, simulated=True) as (bone, _):  # our host sees the same
            ours = Board(bone)
            assert ours.read("ctrl_scratch") == 0xCAFE0123
            assert bone.read(ours.csr.base("pattern_mem"), 32)[31] == 31 * 0x01010101
            assert ours.read("ctrl_bus_errors") == 0
