"""Opens and writes first-spike files in addition to the formats of cosim."""

from __future__ import annotations

from pathlib import Path

from cosim import InputError, SpikeStream
from cosim.config.units import KINDS, parse_quantity
from cosim.files import FORMATS, ending_of, open_stream
from sensor.codec.coding import CODES, Code
from sensor.codec.fsc import FSC, read_fsc, write_fsc

__all__ = ["choose_code", "is_coded", "open_any", "write_coded"]


def is_coded(path: Path) -> bool:
    """Whether a name is that of a first-spike file."""
    return path.suffix.lower() == FSC


def open_any(path: Path, size: tuple[int, int] | None) -> tuple[SpikeStream, list[str]]:
    """A stream of any format, and notes beyond those of `notes_of`. Raises InputError."""
    if not is_coded(path):
        ending = ending_of(path)
        if path.exists() and not path.is_dir() and ending not in FORMATS and ending != ".yaml":
            raise InputError(
                "the stream", f"a {', '.join((*FORMATS, FSC))} or the folder of a run", str(path),
                "film a clip with `viform run film --set scene.path=...`, or convert the stream",
            )  # fmt: skip
        return open_stream(path, size), []
    stream, code = read_fsc(path)
    height, width = stream.shape
    if size not in (None, (width, height)):
        raise InputError("--size", f"{width}x{height} for {path}", f"{size[0]}x{size[1]}",
                         "leave it out")  # fmt: skip
    if code.lossless:
        return stream, []
    means = f", means of {code.refine} widths" if code.refine else ""
    noise = f" with noise of {code.threshold_noise:g} e" if code.threshold_noise else ""
    return stream, [
        f"{path} holds what is left of a stream: changes beyond {code.k:g} standard deviations at "
        f"a threshold of {code.threshold:g} e{noise}{means}"
    ]


def choose_code(
    out: Path,
    name: str | None,
    k: float | None,
    threshold: str | None,
    noise: str | None,
    refine: int | None,
) -> Code | None:
    """The code that the command line options select; None if `out` is no first-spike file.

    Raises InputError for options that exclude each other.
    """
    settings = {"--k": k, "--threshold": threshold, "--threshold-noise": noise, "--refine": refine}
    options = [option for option, value in settings.items() if value is not None]
    if not is_coded(out):
        if name is not None or options:
            option = "--code" if name is not None else options[0]
            raise InputError(
                option, f"given with a {FSC} to write", str(out), f"leave {option} out"
            )
        return None
    if name not in (None, *CODES):
        raise InputError("--code", f"one of {', '.join(CODES)}", repr(name), "choose one")
    if name != "statistical":
        if options:
            raise InputError(
                options[0], "given with --code statistical", f"with {name or 'line'}",
                f"leave {options[0]} out",
            )  # fmt: skip
        return Code("repeat" if name == "repeat" else "line")
    if k is None or threshold is None:
        missing = "--threshold '1000 e'" if threshold is None else "--k 3"
        raise InputError(
            "--code statistical", "given with --k and --threshold", "without", f"add {missing}"
        )
    charge = {}
    for option, text in (("--threshold", threshold), ("--threshold-noise", noise or "0 e")):
        try:
            charge[option] = parse_quantity(text, KINDS["charge"])
        except ValueError:
            raise InputError(option, str(KINDS["charge"]), repr(text), "write it so") from None
    try:
        return Code(
            "statistical", k, charge["--threshold"], charge["--threshold-noise"], refine or 0
        )
    except ValueError as exc:
        what, _, rest = str(exc).partition(" must be ")
        must, _, value = rest.rpartition(", not ")
        raise InputError(f"--{what.replace(' ', '-')}", must, value, "change it") from None


def write_coded(stream: SpikeStream, path: Path, code: Code) -> None:
    """Writes a first-spike file."""
    write_fsc(stream, path, code)
