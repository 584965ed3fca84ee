"""`viform board`: a test board over its serial line, real or virtual."""

import typer

from scenarios.commands.board_bringup import board_bringup
from scenarios.commands.board_capture import board_capture
from scenarios.commands.board_compare import board_compare
from scenarios.commands.board_gateware import board_gateware
from scenarios.commands.board_identify import board_identify
from scenarios.commands.board_prbs import board_prbs
from scenarios.commands.board_regs import board_regs
from scenarios.commands.board_replay import board_replay
from scenarios.commands.board_virtual import board_virtual

__all__ = ["board"]

board = typer.Typer(
    name="board",
    help="A test board over its serial line: a real one, or one of Verilog in a simulator.",
    no_args_is_help=True,
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
board.command("replay")(board_replay)
board.command("virtual")(board_virtual)
board.command("gateware")(board_gateware)
