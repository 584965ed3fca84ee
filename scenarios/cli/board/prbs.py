"""`viform board prbs`: measures bit errors of the line in both directions."""

from __future__ import annotations

from typing import Annotated

import typer

from cosim.config.amounts import count, elapsed
from scenarios.cli.board.connection import BoardOptions, connect
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell


@expand_options
def board_prbs(
    options: BoardOptions,
    order: Annotated[
        list[int] | None, typer.Option(help="7, 15, 23 or 31, repeatable; all when absent")
    ] = None,
    words: Annotated[
        int,
        typer.Option(min=1, max=10_000_000, help="32-bit words in each direction, for each order"),
    ] = 1024,
    json: Json = False,
) -> None:
    """Count wrong bits of pseudo-random words to and from the board. Exit 1 if there are any."""
    from rtl_model.host import prbs

    with connect(options, json) as connection:
        reports = [prbs.check(connection.board, one, words) for one in order or prbs.ORDERS]
    clean = all(report.clean for report in reports)
    if json:
        rows = [report._asdict() | {"clean": report.clean} for report in reports]
        print_document({"ok": clean, "orders": rows})
    else:
        for report in reports:
            tell(
                f"order {report.order:>2}: {count(32 * report.words)} bits in each direction, "
                f"{report.bits_wrong_from_board} wrong from the board, "
                f"{report.bits_wrong_to_board} to the board, "
                f"{report.words_lost_to_board} words lost, {report.faults} answers interrupted, "
                f"{elapsed(report.seconds)}"
            )
    if not clean:
        raise typer.Exit(1)
