"""`viform calibrate`: the parameters of a real camera from its recordings, as a preset."""

from __future__ import annotations

import math
import shlex
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.run.called import as_called
from cosim.run.shown import make_progress
from scenarios.cli.output import Json, print_document, size_option, tell

if TYPE_CHECKING:
    from sensor.calibrate.calibration import Calibration


def calibrate(
    recording: Annotated[
        Path,
        typer.Argument(
            help="any recording of the camera: .dat, .raw, .npz, .zarr, or the folder of a run"
        ),
    ],
    dark: Annotated[Path | None, typer.Option(help="recording with the lens capped")] = None,
    flat: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE[=LIGHT]",
            help="recording of constant uniform light; =LIGHT states its light relative to that of "
            "other flats",
        ),
    ] = None,
    size: Annotated[str | None, typer.Option(help="WxH of recordings without a header")] = None,
    clock: Annotated[
        str | None, typer.Option(help="latch clock, such as '20 kHz' [the recording's, or 40 kHz]")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="folder to create [runs/calibrate-N]")] = None,
    json: Json = False,
) -> None:
    """Find the parameters of a spike camera and their 95 % limits from its recordings.

    Writes camera.toml for sensor.preset, and says what the recordings cannot tell and why.
    """
    from cosim import Clock, InputError
    from cosim.config.quantity import Quantity
    from cosim.files import notes_of
    from cosim.run.folder import claim_folder, output_folder
    from scenarios.cli.start import BEGAN
    from sensor.calibrate.calibration import Recording, calibrate
    from sensor.calibrate.page import write_calibration
    from sensor.codec.files import open_any

    # A folder that is taken is refused before the work.
    output_folder("calibrate", out, False, goes_on=False)
    stated = None
    if clock is not None:
        try:
            stated = Clock.from_hz(Quantity("frequency", above=0, most=1e9).read(clock))
        except ValueError as exc:
            must = str(exc).removeprefix("must be ")
            raise InputError("--clock", must, repr(clock), "write --clock '20 kHz'") from None
    pixels, notes = size_option(size), []

    def opened(path: Path, light: float | None = None) -> Recording:
        stream, told = open_any(path, pixels)
        notes.extend([*told, *notes_of(stream)])
        return Recording(str(path), stream, light)

    main = opened(recording)
    flats = [opened(*_flat(text)) for text in flat or ()]
    black = None if dark is None else opened(dark)
    progress = make_progress()
    try:
        result = calibrate(main, flats, black, clock=stated, progress=progress)
        for note in dict.fromkeys(notes):
            progress.note(note)
    finally:
        progress.close()
    with claim_folder("calibrate", out, False, goes_on=False) as folder:
        document = write_calibration(result, folder, BEGAN)
    if json:
        print_document(document)
    else:
        tell(*_text(result, document, folder))


def _flat(text: str) -> tuple[Path, float | None]:
    """File and light of a --flat."""
    from cosim import InputError

    name, equals, light = text.rpartition("=")
    if not equals or Path(text).exists():
        return Path(text), None
    try:
        value = float(light)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise InputError(
            "--flat", "FILE or FILE=LIGHT with a number above 0", repr(text),
            "write --flat a.dat=1 --flat b.dat=2",
        )  # fmt: skip
    return Path(name), value


def _text(result: Calibration, document: dict[str, Any], folder: Path) -> list[str]:
    """The result as text."""
    known = [p for p in result.parameters.values() if p.known]
    unknown = [p for p in result.parameters.values() if not p.known]
    lines = [f"{name}: {role}" for name, role in result.roles.items()]
    lines += ["", "known, with limits of 95 %"]
    lines += [f"  {p.title:<64}{p.text}" for p in known] or ["  nothing"]
    lines += ["", "not known, and why"]
    for p in unknown:
        limits = f", {p.text}" if p.text else ""
        lines.append(f"  {p.title}{limits}: {p.why}; {p.remedy}")
    fits = document["does_not_fit"]
    if result.histograms or fits:
        lines += ["", "what does not fit", *(f"  {line}" for line in fits or ("nothing",))]
    lines += ["", *result.notes] if result.notes else [""]
    if document["twin"] is not None:
        lines.append(document["twin"]["verdict"])
    preset = folder / "camera.toml"
    lines.append(f"{folder / 'report.html'}")
    if "camera.toml" in document["files"]:
        text = preset.read_text(encoding="utf-8")
        lines.append(as_called(film_command(text, preset)))
    else:
        lines.append("no camera.toml: it takes the temporal noise, which is not known")
    return lines


def film_command(preset: str, path: Path) -> str:
    """The command that films with a preset. A scenario's own keys win over a preset's, so those
    that `film` has as well are given: its threshold may have more shot noise than the camera has
    noise. Its light is raised as the camera needs more of it, for the same lens.

    Args:
        preset: text of the file.
        path: path of the file.
    """
    from cosim.config.quantity import Quantity
    from scenarios.assemble.schema.loading import load

    film: Any = load("film")[1]
    own = tomllib.loads(preset)["sensor"]
    sets = {"sensor.preset": str(path)}
    sets |= {f"sensor.{key}": own[key] for key in ("threshold", "clock")}
    more = Quantity("charge").read(own["threshold"]) / film.sensor.threshold
    more *= Quantity("frequency").read(own["clock"]) / film.sensor.clock
    if more > 1:
        lux = math.ceil(film.scene.illuminance * more)
        sets["scene.illuminance"] = Quantity("illuminance").write(lux)
    return "viform run film " + " ".join(
        f"--set {key}={shlex.quote(value)}" for key, value in sets.items()
    )
