"""`viform compare`: one scene, recorded by all cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.run.shown import make_progress
from scenarios.cli.options import Device
from scenarios.cli.output import Json, print_document, tell


def compare(
    scene: Annotated[
        str, typer.Argument(help="a name from `viform list`, a TOML file, or a kind of scene")
    ] = "star",
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="override duration or a key of scene, lens, spike, or an imager such as ebaps",
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="seed of all temporal noise")] = None,
    out: Annotated[
        Path | None, typer.Option(help="folder to create [runs/compare-SCENE-N]")
    ] = None,
    device: Device = None,
    json: Json = False,
) -> None:
    """Record one scene with the spike camera and every other imager, and compare the results."""
    from scenarios.cli.start import BEGAN
    from scenarios.studies.compare import load_comparison, run_compare

    comparison = load_comparison(scene, assignments or (), seed)
    progress = make_progress()
    try:
        document, folder = run_compare(comparison, out, device, progress, BEGAN)
    finally:
        progress.close()
    if json:
        print_document(document)
    else:
        tell(*_text(document, folder))


def _text(document: dict[str, Any], folder: Path) -> list[str]:
    """The table as text."""
    from scenarios.studies.compare.report import HEADS, figure_text
    from scenarios.studies.compare.row import FIGURES, Figure

    rows = document["rows"]
    cells = [["", *(row["title"] for row in rows)]]
    cells += [[HEADS[n], *(figure_text(n, Figure(**row[n])) for row in rows)] for n in FIGURES]
    widths = [max(len(line[n]) for line in cells) for n in range(len(cells[0]))]
    lines = [
        "  ".join([line[0].ljust(widths[0]),
                   *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))])
        for line in cells
    ]  # fmt: skip
    lines += [f"  {row['title']}: {row['setting']}" for row in rows]
    return [*lines, *document["notes"], f"{folder / 'report.html'}"]
