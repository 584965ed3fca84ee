"""`viform board`: a test board over its serial line, real or virtual."""

import typer

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


@board.callback()
def _group() -> None:
    """Keeps the group a group while it has one command."""


board.command("virtual")(board_virtual)
