"""The host's side of a board: LiteX's uartbone and Etherbone, registers by name, capture, logs.

The code is the same for a board, its Verilog in a simulator, or a replayed log.
"""

from rtl_model.host import capture, pattern, prbs
from rtl_model.host.baud import BaudReport, find_baud
from rtl_model.host.board import Board, BoardInfo, recognised
from rtl_model.host.bone import Bone, opened_bone
from rtl_model.host.capture import Captured
from rtl_model.host.csr import CsrMap, default_map, read_csr
from rtl_model.host.faults import Cause, LineFault
from rtl_model.host.log import LineLog
from rtl_model.host.ports import Lines, Port, SerialPort, is_pty, open_port
from rtl_model.host.reading import Reading, check_levels, read_charges
from rtl_model.host.replay import ReplayPort
from rtl_model.host.uartbone import BAUD_MIN, Uartbone

__all__ = [
    "BAUD_MIN",
    "BaudReport",
    "Board",
    "BoardInfo",
    "Bone",
    "Captured",
    "Cause",
    "CsrMap",
    "LineFault",
    "LineLog",
    "Lines",
    "Port",
    "Reading",
    "ReplayPort",
    "SerialPort",
    "Uartbone",
    "capture",
    "check_levels",
    "default_map",
    "find_baud",
    "is_pty",
    "open_port",
    "opened_bone",
    "pattern",
    "prbs",
    "read_charges",
    "read_csr",
    "recognised",
]
