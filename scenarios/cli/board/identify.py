"""`viform board identify`: identifies the design behind a port."""

from __future__ import annotations

from scenarios.cli.board.connection import LineOptions, connect
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell


@expand_options
def board_identify(
    options: LineOptions,
    json: Json = False,
) -> None:
    """Identify a Viform board or imager, with its size and build, or another LiteX design by its
    csr.csv."""
    from rtl_model.host import BoardInfo, Cause, LineFault

    with connect(options, json, recognise=True, confirm=False) as connection:
        board = connection.board
        rate = connection.baud
        has_name = "identifier_mem" in {*board.csr.bases, *board.csr.memories}
        identifier = board.identifier() if has_name else None
        document: dict[str, object] = {
            "ok": True, "port": connection.url, "baud": rate, "identifier": identifier,
        }  # fmt: skip
        try:
            info = board.imager_info() if board.csr.imager else board.info()
        except LineFault as fault:
            if fault.cause is not Cause.NOT_OURS or options.csr is None:
                raise
            document |= {"ours": False, "registers": len(board.csr.registers)}
        else:
            document |= {"ours": True, "registers": len(board.csr.registers)}
            found = info._asdict() | {"build": f"{info.build:08x}"}
            document |= {"board": found if rate else found | {"baud": None}}
            if isinstance(info, BoardInfo) and info.build_matches is not None:
                document |= {"build_matches": info.build_matches}
    if json:
        print_document(document)
        return
    line = "" if rate is None else f", {rate} baud"
    tell(f"{'port':<14} {document['port']}{line}")
    tell(f"{'identifier':<14} {identifier or 'none'}")
    board_rows = document.get("board")
    if isinstance(board_rows, dict):
        for name, value in board_rows.items():
            if value is None:  # baud, over UDP
                continue
            tell(f"{name:<14} {value:#x}" if name == "version" else f"{name:<14} {value}")
        if "build_matches" in document:
            origin = "this program's" if document["build_matches"] else "not this program's"
            tell(f"{'verilog':<14} {origin}, by the build's CRC-32")
    else:
        tell(f"{'design':<14} foreign, {document['registers']} registers in its csr.csv")
