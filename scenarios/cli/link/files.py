"""A file through a recording of a link: as the planes that a panel shows (`viform link send`), and
out of a stream that filmed the panel (`receive`).

The functions import what they need: the start of other commands must not wait for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.config.amounts import amount, count, number
from cosim.run.shown import SilentProgress, make_progress
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, size_option, tell

if TYPE_CHECKING:
    from cosim import Clock
    from link.receiving import Received

_MOST_BLOCKS = 100_000
"""Most blocks of one rate in --rates."""
_WORDS = 8
"""Words of a block that is read at a time: 256 ticks."""


@dataclass(frozen=True)
class SendOptions:
    """The panel and the modulation."""

    size: Annotated[str, typer.Option(help="size of the panel, WxH, multiples of 32")] = "960x960"
    cell: Annotated[int, typer.Option(help="panel pixels to a cell's side")] = 2
    ticks: Annotated[int, typer.Option(help="planes to a symbol")] = 2
    line: Annotated[
        str, typer.Option(help="code along time, a value of the key link.line except auto")
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


def link_receive(
    stream: Annotated[
        Path,
        typer.Argument(help=".dat, .raw, .npz, .zarr, .events.npz, .fsc, .vfl, or a run's folder"),
    ],
    out: Annotated[Path, typer.Option(help="folder to write to; the file goes to received/")],
    detector: Annotated[
        str, typer.Option(help="packed, joint, threshold or forward-backward")
    ] = "packed",
    interleave: Annotated[
        bool, typer.Option("--interleave/--no-interleave", help="interleaving as the sender had it")
    ] = True,
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    json: Json = False,
) -> None:
    """Receive a file from a stream in which a camera saw a panel send it.

    The file is written only when it is whole; else the verdict says why not, and the exit is 1.
    """
    from cosim import InputError, Viform
    from cosim.files import notes_of
    from cosim.run.result import dumps
    from cosim.spikes.viform import WORD, words_for
    from link.detect.catalogue import DETECTORS
    from link.receiving import Receiver
    from sensor.codec.files import open_any

    if detector not in DETECTORS:
        raise InputError(
            "--detector", f"one of {', '.join(DETECTORS)}", repr(detector), "choose one"
        )
    if any((out / "received").glob("*")):  # it would stand beside the verdict of another stream
        raise InputError(
            "--out", "a folder where nothing has been received", str(out), "choose another"
        )
    opened, notes = open_any(stream, size_option(size))
    receiver = Receiver(opened.shape, detector=detector, interleave=interleave)
    for first in range(0, words_for(opened.cycles), _WORDS):
        words = opened.read_words(first, min(first + _WORDS, words_for(opened.cycles)))
        cycles = min(opened.cycles - first * WORD, len(words) * WORD)
        receiver.step(Viform(words, cycles, opened.clock, first * WORD))
    received = receiver.finish()
    document = _document(stream, received, opened.clock)
    _write(out, received, dumps(document))
    for note in (*notes, *notes_of(opened)):
        SilentProgress().note(note)
    if json:
        print_document(document)
    else:
        _tell(document)
    if not received.whole:
        raise typer.Exit(1)


def _document(stream: Path, received: Received, clock: Clock) -> dict[str, Any]:
    """What receive.json says."""
    r, mode, timing = received, received.mode, received.timing
    out: dict[str, Any] = {
        "stream": str(stream), "outcome": "received" if r.whole else "failed",
        "cause": r.verdict.cause.name.lower(), "verdict": r.verdict.text, "ticks": r.ticks,
        "clock_hz": clock.hz,
        "file": None, "mode": None, "timing": None,
        "frames": {"seen": r.frames_read, "right": r.frames_right, "needed": r.frames_needed},
        "codewords": {"read": r.codewords, "lost": r.codewords_wrong,
                      "bytes_mended": r.bytes_corrected},
    }  # fmt: skip
    if mode is not None:
        out["mode"] = {
            "width": mode.width, "height": mode.height, "cell": mode.cell, "ticks": mode.ticks,
            "line": mode.line, "parity": mode.parity, "rate": mode.rate,
        }  # fmt: skip
    if mode is not None and timing is not None:
        assert r.registration is not None
        out["timing"] = {
            "first_tick": timing.first, "symbol_ticks": timing.period, "slope_ticks": timing.slope,
            "clock_offset_ppm": (mode.ticks / timing.period - 1) * 1e6,
            "clock_error_ppm": r.clock_error,
        }  # fmt: skip
        out["blur_pixels"] = r.registration.blur
        out["homography"] = r.registration.homography.tolist()
    if r.delivered is not None:
        data, name = r.delivered
        out["file"] = {"name": name, "bytes": len(data)}
        out["goodput_bps"] = _goodput(r, len(data), clock)
    return out


def _goodput(r: Received, size: int, clock: Clock) -> float | None:
    """File bits over first light, or the stream's begin, to the end of the last verified byte's
    cycle."""
    if r.delivered_tick is None or r.timing is None:
        return None
    begin = r.timing.first if r.first_light is not None else 0.0
    return 8 * size * clock.hz / (r.delivered_tick + 1 - max(begin, 0.0))


def _write(out: Path, received: Received, document: str) -> None:
    from cosim import InputError
    from cosim.files.atomic import atomic_write

    place = out / "received"
    try:
        (place if received.whole else out).mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise InputError(
            "--out", "a folder that can be made", f"{out} ({exc.strerror})", "choose another"
        ) from exc
    if received.whole and received.delivered is not None:
        data, name = received.delivered
        with atomic_write(place / name) as part:
            part.write_bytes(data)
    with atomic_write(out / "receive.json") as part:
        part.write_text(document + "\n", encoding="utf-8")


def _tell(document: dict[str, Any]) -> None:
    from link.mode import word_code

    tell(f"{document['outcome']}: {document['verdict']}")
    if document["file"] is not None:
        rate = document["goodput_bps"]
        shown = f", {amount(rate, 'bit/s', 4)}" if rate is not None else ""
        tell(f"file: {document['file']['name']}, {count(document['file']['bytes'])} bytes{shown}")
    if document["timing"] is not None:
        mode, timing = document["mode"], document["timing"]
        first, offset = round(timing["first_tick"], 2), round(timing["clock_offset_ppm"])
        tell(
            f"mode: {mode['width']}x{mode['height']}, cells {mode['cell']}, ticks {mode['ticks']}, "
            f"{mode['line']}, {word_code(mode['parity'], mode['rate'])}; first light at tick "
            f"{first + 0.0:.2f}, clock {offset:+d} ppm, "  # + 0.0: never -0.00
            f"known to {timing['clock_error_ppm']:.0f} ppm"
        )
        frames = document["frames"]
        tell(f"frames: {frames['right']} right of {frames['seen']}, needed {frames['needed']}")
