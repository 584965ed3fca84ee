"""`viform link receive`: a file out of a stream that filmed a panel.

The functions import what they need: the start of other commands must not wait for it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.config.amounts import amount, count
from cosim.run.shown import SilentProgress
from scenarios.cli.output import Json, print_document, size_option, tell

if TYPE_CHECKING:
    from cosim import Clock
    from link.receiving import Received

_WORDS = 8
"""Words of a block that is read at a time: 256 ticks."""


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
    from cosim.files.whole import whole

    place = out / "received"
    try:
        (place if received.whole else out).mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise InputError(
            "--out", "a folder that can be made", f"{out} ({exc.strerror})", "choose another"
        ) from exc
    if received.whole and received.delivered is not None:
        data, name = received.delivered
        with whole(place / name) as part:
            part.write_bytes(data)
    with whole(out / "receive.json") as part:
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
