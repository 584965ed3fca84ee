"""`viform laboratory`: measures a modelled camera by EMVA 1288."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from scenarios.cli.output import Json, print_document

__all__ = ["laboratory"]

_STANDARD = "EMVA 1288 release 4.0 linear"


def laboratory(
    camera: Annotated[
        str, typer.Argument(help="spiketwo, spikeone, adaptive-exposure, ebaps or emccd")
    ],
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="seed of all temporal noise")] = 1,
    figure: Annotated[
        Path | None, typer.Option(help="figure of the photon transfer to draw, .png or .svg")
    ] = None,
    json: Json = False,
) -> None:
    """Measure the photon transfer of a modelled camera by EMVA 1288, as in a laboratory."""
    from cosim import InputError
    from cosim.files.whole import whole
    from sensor.laboratory.cameras import CAMERAS
    from sensor.laboratory.emva import measure_camera

    if camera not in CAMERAS:
        raise InputError("CAMERA", f"one of {', '.join(CAMERAS)}", repr(camera), "choose one")
    if figure is not None and figure.suffix.lower() not in (".png", ".svg"):
        raise InputError("--figure", "a .png or .svg", str(figure), "choose one")
    if figure is not None and not figure.absolute().parent.is_dir():
        raise InputError("--figure", "in a folder that exists", str(figure), "create the folder")
    chosen = CAMERAS[camera]
    report = measure_camera(chosen.bench(seed))
    if figure is not None:
        from sensor.laboratory.figure import photon_transfer_figure

        with whole(figure) as part:
            photon_transfer_figure(report, chosen.title, part, figure.suffix[1:].lower())
    document = {
        "camera": camera,
        "title": chosen.title,
        "standard": _STANDARD,
        "seed": seed,
        "confidence": report.level,
        "rows": report.rows(),
        "notes": [*chosen.notes, *report.notes],
        "curve": report.transfer.curve(),
        "figure": None if figure is None else str(figure),
    }
    if json:
        print_document(document)
    else:
        print(_text(document))


def _text(document: dict[str, Any]) -> str:
    """The document as text."""
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
        limits = f"[{row['low']:.4g}, {row['high']:.4g}]"
        unit = "" if row["unit"] == "1" else row["unit"]
        lines.append(
            f"{row['symbol']:<10}{row['value']:>11.4g}  {limits:<26}{unit:<11}{row['what']}"
        )
    lines += ["", *document["notes"]]
    if document["figure"] is not None:
        lines.append(f"figure: {document['figure']}")
    return "\n".join(lines)
