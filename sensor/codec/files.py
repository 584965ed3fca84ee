"""Opens and writes first-spike and packet files in addition to the formats of cosim."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cosim import InputError, SpikeStream
from cosim.config.units import KINDS, parse_quantity
from cosim.files import FORMATS, ending_of, open_stream
from sensor.codec.coding import CODES, Code
from sensor.codec.fsc import FSC, read_fsc, write_fsc
from sensor.codec.packets.catalogue import KINDS as KINDS_OF_CODES
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.vfl import VFL, VflStream, write_vfl


def is_coded(path: Path) -> bool:
    """Whether a name is that of a first-spike or packet file."""
    return path.suffix.lower() in (FSC, VFL)


def open_any(path: Path, size: tuple[int, int] | None) -> tuple[SpikeStream, list[str]]:
    """A stream of any format, and notes beyond those of `notes_of`. Raises InputError."""
    if not is_coded(path):
        ending = ending_of(path)
        if path.exists() and not path.is_dir() and ending not in FORMATS and ending != ".yaml":
            raise InputError(
                "the stream", f"a {', '.join((*FORMATS, FSC, VFL))} or the folder of a run",
                str(path),
                "film a clip with `viform run film --set scene.path=...`, or convert the stream",
            )  # fmt: skip
        return open_stream(path, size), []
    stream: SpikeStream
    code: Code | StreamCode
    if path.suffix.lower() == VFL:
        packets = VflStream(path)
        stream, code = packets, packets.code
    else:
        stream, code = read_fsc(path)
    height, width = stream.shape
    if size not in (None, (width, height)):
        raise InputError("--size", f"{width}x{height} for {path}", f"{size[0]}x{size[1]}",
                         "leave it out")  # fmt: skip
    if code.lossless:
        return stream, []
    return stream, [f"{path} holds what is left of a stream: {left(code)}"]


def left(code: Code | StreamCode) -> str:
    """What a code that loses something keeps."""
    if isinstance(code, StreamCode) and code.kind == "layered":
        return f"the first {code.layers} layers, with the other spikes spread evenly"
    means = f", means of {code.refine} widths" if code.refine else ""
    noise = f" with noise of {code.threshold_noise:g} e" if code.threshold_noise else ""
    return (
        f"changes beyond {code.k:g} standard deviations at a threshold of "
        f"{code.threshold:g} e{noise}{means}"
    )


def choose_code(
    out: Path,
    name: str | None,
    k: float | None,
    threshold: str | None,
    noise: str | None,
    refine: int | None,
    layers: int | None,
    cycles: int | None,
) -> Code | StreamCode | None:
    """The code that the command line options select; None if `out` is no coded file.

    Raises InputError for options that exclude each other.
    """
    packets = {"--layers": layers, "--cycles": cycles}
    settings = {"--k": k, "--threshold": threshold, "--threshold-noise": noise, "--refine": refine}
    ending = out.suffix.lower()
    given = [o for o, value in {"--code": name, **settings, **packets}.items() if value is not None]
    needs = FSC if not given or given[0] not in packets else VFL
    if given and (not is_coded(out) or (needs == VFL and ending != VFL)):
        raise InputError(
            given[0], f"given with a {needs} to write", str(out), f"leave {given[0]} out"
        )
    if not is_coded(out):
        return None
    names, usual = (tuple(KINDS_OF_CODES), "layered") if ending == VFL else (CODES, "line")
    if name not in (None, *names):
        raise InputError("--code", f"one of {', '.join(names)}", repr(name), "choose one")
    chosen = name or usual
    options = [option for option, value in settings.items() if value is not None]
    if chosen != "statistical" and options:
        raise InputError(
            options[0], "given with --code statistical", f"with {chosen}",
            f"leave {options[0]} out",
        )  # fmt: skip
    if chosen != "layered" and layers is not None:
        raise InputError("--layers", "given with --code layered", f"with {chosen}", "leave it out")
    values: dict[str, Any] = {}
    if chosen == "statistical":
        if k is None or threshold is None:
            missing = "--threshold '1000 e'" if threshold is None else "--k 3"
            raise InputError(
                "--code statistical", "given with --k and --threshold", "without", f"add {missing}"
            )
        values = {"k": k, "refine": refine or 0, **_charges(threshold, noise)}
    if ending == VFL:
        values |= {n[2:]: value for n, value in packets.items() if value is not None}
    try:
        return StreamCode(chosen, **values) if ending == VFL else Code(chosen, **values)  # type: ignore[arg-type]
    except ValueError as exc:
        what, _, rest = str(exc).partition(" must be ")
        must, _, value = rest.rpartition(", not ")
        raise InputError(
            f"--{what.replace(' ', '-')}", must, value, "write a value of these"
        ) from None


def _charges(threshold: str, noise: str | None) -> dict[str, float]:
    """The charges of the statistical code from their options."""
    charges = {}
    for option, text in (("--threshold", threshold), ("--threshold-noise", noise or "0 e")):
        try:
            charges[option[2:].replace("-", "_")] = parse_quantity(text, KINDS["charge"])
        except ValueError:
            raise InputError(option, str(KINDS["charge"]), repr(text), "write it so") from None
    return charges


def write_coded(stream: SpikeStream, path: Path, code: Code | StreamCode) -> None:
    """Writes a first-spike or packet file."""
    if isinstance(code, StreamCode):
        write_vfl(stream, path, code)
    else:
        write_fsc(stream, path, code)
