"""`viform link send`: a file as the planes that a panel shows, in a stream file.

The functions import what they need: the start of other commands must not wait for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from cosim.config.amounts import amount, count, number
from cosim.run.shown import make_progress
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document

_MOST_BLOCKS = 100_000
"""Most blocks of one rate in --rates."""


@dataclass(frozen=True)
class SendOptions:
    """The panel and the modulation."""

    size: Annotated[str, typer.Option(help="size of the panel, WxH, multiples of 32")] = "960x960"
    cell: Annotated[int, typer.Option(help="panel pixels to a cell's side")] = 2
    ticks: Annotated[int, typer.Option(help="planes to a symbol")] = 2
    line: Annotated[
        str, typer.Option(help="code along time: scrambled, none, manchester, 4b6b or 8b10b")
    ] = "8b10b"
    parity: Annotated[int, typer.Option(help="bytes of 255 that are parity: 16 to 128")] = 32
    rate: Annotated[
        float | None,
        typer.Option(
            help="rate of an LDPC code, .75 to .97, in place of parity; scrambled symbols only"
        ),
    ] = None
    rates: Annotated[
        str | None,
        typer.Option(
            help="rates of the blocks of LDPC words, .4 to .97, with the numbers of blocks, such "
            "as 0.65x12,0.97; the last one is that of all later blocks; in place of rate and parity"
        ),
    ] = None
    interleave: Annotated[
        bool,
        typer.Option(
            help="spread each codeword over the panel; the receiver needs the same setting"
        ),
    ] = True
    overhead: Annotated[
        float, typer.Option(help="frames beyond the file's own, as a share of them")
    ] = 0.05
    clock: Annotated[str, typer.Option(help="clock of the panel's planes")] = "40 kHz"


@expand_options
def link_send(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="any file, an empty one too")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="STREAM", help="file to write: .zarr, .npz, .events.npz, .dat or .raw"
        ),
    ],
    panel: SendOptions,
    json: Json = False,
) -> None:
    """Write the planes that send FILE, for a panel to show and `viform link receive` to read."""
    from cosim import Clock, InputError
    from cosim.config.units import KINDS, parse_quantity
    from cosim.files import FORMATS, ending_of, write_stream
    from link.layout import TRAINING
    from link.mode import Mode
    from link.sending import FileTransmission, PlaneStream

    if ending_of(out) not in FORMATS:
        given, remedy = str(out), "give it one of these"
        raise InputError("--out", f"a name ending in {', '.join(FORMATS)}", given, remedy)
    try:
        hz = parse_quantity(panel.clock, KINDS["frequency"])
        panel_clock = Clock.from_hz(hz)
    except ValueError as exc:
        remedy = "write it like that"
        raise InputError(
            "--clock", "a frequency such as '40 kHz'", repr(panel.clock), remedy
        ) from exc
    width, height = _sides(panel.size)
    rates = _rates(panel)
    data = _read(source)
    try:
        parity = panel.parity if panel.rate is None and not rates else None
        mode = Mode(
            width, height, panel.cell, panel.ticks, panel.line, parity, panel.rate, bool(rates)
        )
        sent = FileTransmission(
            mode, data, source.name, interleave=panel.interleave, overhead=panel.overhead,
            rates=rates,
        )  # fmt: skip
    except ValueError as exc:
        raise _refused(str(exc)) from exc
    progress = make_progress()
    try:
        lost = write_stream(PlaneStream(sent, panel_clock), out)
    finally:
        progress.close()
    for note in lost:
        progress.note(note)
    seconds = sent.planes / panel_clock.hz
    repair, fill = sent.outbox.frames_beyond(sent.groups)
    if json:
        print_document(
            {
                "file": str(source), "out": str(out), "bytes": len(data),
                "width": width, "height": height, "cell": mode.cell, "ticks": mode.ticks,
                "line": mode.line, "parity": mode.parity, "rate": mode.rate,
                "rates": [[rate, blocks] for rate, blocks in sent.outbox.runs],
                "interleave": panel.interleave, "tags": list(mode.tags),
                "clock_hz": panel_clock.hz, "planes": sent.planes, "symbols": sent.symbols,
                "training": TRAINING, "groups": sent.outbox.groups,
                "closing": sent.layout.closing,
                "frames": sent.outbox.frames, "frames_needed": sent.outbox.frames_needed,
                "frames_repair": repair, "frames_fill": fill,
                "room_bytes": sent.outbox.room,
                "seconds": seconds, "goodput_bps": 8 * len(data) / seconds,
            }
        )  # fmt: skip
    else:
        rate = 8 * len(data) / seconds
        known = TRAINING + sent.layout.closing
        progress.note(
            f"{count(len(data))} bytes in {count(sent.outbox.frames)} frames "
            f"({count(sent.outbox.frames_needed)} are enough, {fill} only fill the last group), "
            f"{count(sent.planes)} planes, {amount(seconds, 's', 4)}: at most "
            f"{amount(rate, 'bit/s', 4)}; up to "
            f"{count(sent.outbox.room)} bytes take as long, and {known} of "
            f"{count(sent.symbols)} symbols are training and closing"
        )


def _sides(text: str) -> tuple[int, int]:
    from cosim import InputError

    width, x, height = text.lower().partition("x")
    if not (x and width.isdecimal() and height.isdecimal() and len(text) < 12):
        raise InputError("--size", "WIDTHxHEIGHT such as 960x960", repr(text), "write it like that")
    return int(width), int(height)


def _rates(panel: SendOptions) -> list[int]:
    """Numbers of the blocks' rates; none without --rates."""
    from cosim import InputError
    from link.mode import EVERY_RATE

    if panel.rates is None:
        return []
    if panel.rate is not None:
        raise InputError(
            "--rates", "given without --rate", str(panel.rate), "leave one of them out"
        )
    try:
        out: list[int] = []
        for part in panel.rates.split(","):
            rate, _, blocks = part.partition("x")
            count = int(blocks or 1)
            if not 1 <= count <= _MOST_BLOCKS:
                raise ValueError(part)
            out += [EVERY_RATE.index(float(rate))] * count
        return out
    except ValueError as exc:
        raise InputError(
            "--rates", f"rates of {', '.join(map(str, sorted(EVERY_RATE)))}, each with the number "
            f"of its blocks, 1 to {_MOST_BLOCKS}, or alone for one", repr(panel.rates),
            "write them like 0.65x12,0.97",
        ) from exc  # fmt: skip


def _read(path: Path) -> bytes:
    from cosim import InputError
    from link.coding import MOST_BYTES

    try:
        length = path.stat().st_size
        if length <= MOST_BYTES:
            return path.read_bytes()
    except OSError as exc:
        given = f"{path} ({exc.strerror or exc})"
        raise InputError("FILE", "a file that can be read", given, "check it") from exc
    must = f"at most {MOST_BYTES // 2**20} MiB"
    raise InputError("FILE", must, f"{number(length / 2**20, 6)} MiB", "send it in parts")


def _refused(text: str) -> Exception:
    """A ValueError's "what must be X, not Y" as bad input."""
    from cosim import InputError

    what, _, rest = text.partition(" must be ")
    must, _, given = rest.rpartition(", not ")
    if not (what and must and given):
        return InputError("the link", "one that can be sent", text, "choose another mode")
    flag = {"width": "--size", "height": "--size", "the file": "FILE"}.get(what, f"--{what}")
    return InputError(flag, must, given, "choose one of these")
