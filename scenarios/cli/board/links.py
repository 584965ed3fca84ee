"""`viform board links`: what links carry of a pixel array, raw and coded."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cosim.config.amounts import amount, number
from cosim.run.shown import make_progress
from scenarios.cli.output import Json, print_document, size_option, tell

_CODES = ("first-spike", "layered")  # the lossless ones


def board_links(
    streams: Annotated[
        list[Path] | None,
        typer.Argument(metavar="STREAM", help="recording on which the codes are measured"),
    ] = None,
    size: Annotated[str, typer.Option(help="columns and rows of the array, WxH")] = "1000x1000",
    clock: Annotated[str, typer.Option(help="planes a second")] = "40 kHz",
    json: Json = False,
) -> None:
    """Say which share of a pixel array's spikes each link carries, raw and in the lossless codes.

    A share of 1 is every plane. The bits per pixel and cycle of a code are those of the recordings,
    headers of packets included.
    """
    from cosim import InputError
    from cosim.config.quantity import Quantity
    from rtl_model.stream.links import LINKS, raw_rate
    from sensor.codec.files import open_any
    from sensor.codec.packets.catalogue import StreamCode
    from sensor.codec.packets.coder import size_of, to_packets

    columns, rows = size_option(size) or (1000, 1000)
    try:
        hz = Quantity("frequency", above=0, most=1e9).read(clock)
    except ValueError as exc:
        must = str(exc).removeprefix("must be ")
        raise InputError("--clock", must, repr(clock), "write --clock '20 kHz'") from None
    raw = raw_rate(rows, columns, hz)
    coded: list[dict[str, object]] = []
    bits = {"raw": 1.0}
    progress = make_progress()
    try:
        opened = [(path, *open_any(path, None)) for path in streams or ()]  # all, before any coding
        names = [path.name for path, _, _ in opened]
        for path, stream, notes in opened:
            for note in notes:
                progress.note(note)
            for kind in _CODES:
                progress.note(f"coding {path} as {kind}")
                measured = size_of(to_packets(stream, StreamCode(kind)), stream)
                coded.append({"stream": str(path), "code": kind, "bits": measured})
                bits[f"{path if names.count(path.name) > 1 else path.name} {kind}"] = measured
    finally:
        progress.close()
    shares = {
        link.name: {name: min(1.0, link.rate / (raw * each)) for name, each in bits.items()}
        for link in LINKS
    }
    if json:
        links = [
            {"link": link.name, "bit_per_s": link.rate, "source": link.source,
             "planes_per_s": link.rate / (rows * columns), "shares": shares[link.name]}
            for link in LINKS
        ]  # fmt: skip
        print_document(
            {"rows": rows, "columns": columns, "clock_hz": hz, "raw_bit_per_s": raw,
             "coded": coded, "links": links}
        )  # fmt: skip
        return
    tell(f"{rows} x {columns} pixels at {amount(hz, 'Hz')}: {amount(raw, 'bit/s', 4)}")
    print()
    tell("| link | Mbit/s |" + "".join(f" {name} |" for name in bits))
    tell("|---|---|" + "---|" * len(bits))
    tell("| bits per pixel and cycle | |" + "".join(f" {each:.3f} |" for each in bits.values()))
    for link in LINKS:
        cells = "".join(f" {number(share)} |" for share in shares[link.name].values())
        tell(f"| {link.name} | {number(link.rate / 1e6, 4)} |{cells}")
