"""`viform board`: a test board over its serial line or over UDP, real or virtual."""

import typer

from scenarios.cli.board.bringup import board_bringup, board_replay
from scenarios.cli.board.capture import board_capture
from scenarios.cli.board.compare import board_compare, board_stream
from scenarios.cli.board.gateware import board_gateware, board_links
from scenarios.cli.board.line import board_identify, board_prbs, board_regs
from scenarios.cli.board.virtual import board_virtual

board = typer.Typer(
    name="board",
    help="A test board over a serial line or Ethernet: real, or of Verilog in a simulator.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
board.command("identify")(board_identify)
board.command("regs")(board_regs)
board.command("prbs")(board_prbs)
board.command("bringup")(board_bringup)
board.command("capture")(board_capture)
board.command("compare")(board_compare)
board.command("stream")(board_stream)
board.command("replay")(board_replay)
board.command("virtual")(board_virtual)
board.command("gateware")(board_gateware)
board.command("links")(board_links)
