"""`viform laboratory`: measures a modelled camera by EMVA 1288, or the laws of a recording.

The laws are statistics of spikes under still light: fixed pattern, common noise, and the variance
and correlation of intervals.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.config.amounts import count, number
from scenarios.cli.options import check_figure
from scenarios.cli.output import Json, print_document, size_option

if TYPE_CHECKING:
    from sensor.laboratory.cameras import Camera

_STANDARD = "EMVA 1288 release 4.0 linear"


def laboratory(
    camera: Annotated[
        str,
        typer.Argument(
            help="spiketwo, spikeone, adaptive-exposure, ebaps or emccd; or a recording of still "
            "light: .dat, .raw, .npz, .zarr, or the folder of a run"
        ),
    ],
    seed: Annotated[
        int | None,
        typer.Option(min=0, max=2**32 - 1, help="seed of a camera's temporal noise [1]"),
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="figure to draw, .png or .svg")] = None,
    size: Annotated[str | None, typer.Option(help="WxH of a recording without a header")] = None,
    json: Json = False,
) -> None:
    """Measure a modelled camera by EMVA 1288, or the laws of a recording of still light."""
    from cosim import InputError

    cameras = _cameras()
    recording = camera not in cameras
    if recording and not Path(camera).exists():
        raise InputError(
            "CAMERA", f"one of {', '.join(cameras)}, or a recording that exists", repr(camera),
            "choose one",
        )  # fmt: skip
    if recording and seed is not None:
        raise InputError("--seed", "given with a camera", "with a recording", "leave it out")
    if not recording and size is not None:
        raise InputError("--size", "given with a recording", "with a camera", "leave it out")
    check_figure(figure, ".png", ".svg")
    document = (
        _laws(Path(camera), size, figure) if recording
        else _emva(cameras[camera], 1 if seed is None else seed, figure)
    )  # fmt: skip
    if json:
        print_document(document)
    else:
        print(_laws_text(document) if recording else _emva_text(document))


def _cameras() -> dict[str, Camera]:
    """All modelled cameras, by name."""
    from imagers.catalogue import measured_cameras
    from sensor.laboratory.cameras import SPIKE_CAMERAS

    return SPIKE_CAMERAS | measured_cameras()


def _emva(chosen: Camera, seed: int, figure: Path | None) -> dict[str, Any]:
    """Measures a modelled camera; draws the figure."""
    from cosim.files.atomic import atomic_write
    from sensor.laboratory.emva import measure_camera

    report = measure_camera(chosen.bench(seed))
    if figure is not None:
        from sensor.laboratory.figure import photon_transfer_figure

        with atomic_write(figure) as part:
            photon_transfer_figure(report, chosen.title, part, figure.suffix[1:].lower())
    return {
        "camera": chosen.name,
        "title": chosen.title,
        "standard": _STANDARD,
        "seed": seed,
        "confidence": report.level,
        "rows": report.rows(),
        "notes": [*chosen.notes, *report.notes],
        "curve": report.transfer.curve(),
        "figure": None if figure is None else str(figure),
    }


def _laws(path: Path, size: str | None, figure: Path | None) -> dict[str, Any]:
    """Measures the laws of a recording; draws the figure."""
    from cosim.files import notes_of
    from cosim.files.atomic import atomic_write
    from sensor.codec.files import open_any
    from sensor.laboratory.laws import measure_laws

    stream, notes = open_any(path, size_option(size))
    laws = measure_laws(stream)
    if laws.motion is not None:
        notes.append(f"the light was not still: {laws.motion}; these laws are also the scene's")
    if figure is not None:
        from sensor.laboratory.figure import laws_figure

        with atomic_write(figure) as part:
            laws_figure(laws, str(path), part, figure.suffix[1:].lower())
    return {
        "recording": str(path), **laws.document(), "notes": [*notes, *notes_of(stream)],
        "figure": None if figure is None else str(figure),
    }  # fmt: skip


def _laws_text(document: dict[str, Any]) -> str:
    """The laws as text."""
    lines = [
        f"{document['recording']}: {count(document['cycles'])} cycles of {document['width']} x "
        f"{document['height']} pixels, {number(document['rate'], 4)} spikes a cycle",
        "",
        f"fixed pattern  {document['core_spread']:.3%} without tails, {document['spread']:.3%} in "
        f"all, kurtosis {number(document['kurtosis'])}",
        f"               {document['above']} pixels above 15 %, {document['below']} below, the "
        f"highest by {number(document['highest'])} spikes a cycle",
        f"rows, columns  {document['row_spread']:.3%}, {document['column_spread']:.3%}; neighbours "
        "correlate by " + " and ".join(f"{c:.3f}" for c in document["neighbours"]),
        f"common noise   {number(document['common_variance'])} times the variance of pixels alone",
        "",
        "mean interval   pixels  variance  correlation of successive intervals",
    ]
    lines += [
        f"{number(law['mean']):>13}{law['pixels']:>9}{law['variance']:>10.4f}{law['correlation']:>13.3f}"
        for law in document["intervals"]
    ]
    lines += ["", *document["notes"]] if document["notes"] else []
    if document["figure"] is not None:
        lines.append(f"figure: {document['figure']}")
    return "\n".join(lines)


def _emva_text(document: dict[str, Any]) -> str:
    """The rows of EMVA 1288 as text."""
    lines = [
        f"{document['title']}, measured by {document['standard']}; limits of "
        f"{document['confidence']:.0%} confidence",
        "",
        f"{'symbol':<10}{'value':>11}  {'limits':<26}{'unit':<11}parameter",
    ]
    section = ""
    for row in document["rows"]:
        if row["section"] != section:
            section = row["section"]
            lines.append(f"-- {section}")
        limits = f"[{number(row['low'], 4)}, {number(row['high'], 4)}]"
        unit = "" if row["unit"] == "1" else row["unit"]
        lines.append(
            f"{row['symbol']:<10}{number(row['value'], 4):>11}  {limits:<26}{unit:<11}{row['what']}"
        )
    lines += ["", *document["notes"]]
    if document["figure"] is not None:
        lines.append(f"figure: {document['figure']}")
    return "\n".join(lines)
