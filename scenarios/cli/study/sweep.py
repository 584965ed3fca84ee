"""`viform sweep`: a scenario over values of its keys."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from scenarios.cli.options import (
    Resume,
    ScenarioName,
    ScenarioOptions,
    Scheduler,
    Tolerance,
    Workers,
    count_workers,
    expand_options,
)
from scenarios.cli.output import Json, make_progress, print_document

__all__ = ["sweep"]


@expand_options
def sweep(
    options: ScenarioOptions,
    scenario: ScenarioName = "film",
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUES", help="a,b,c; lo:hi:n; lo:hi:nlog; lo:hi with --samples"),
    ] = None,
    samples: Annotated[
        int | None, typer.Option(help="points of a Latin hypercube [all combinations]")
    ] = None,
    metric: Annotated[
        list[str] | None, typer.Option(help="drawn in the figure [those that vary most]")
    ] = None,
    tolerance: Tolerance = None,
    out: Annotated[
        Path | None, typer.Option(help="folder to create [runs/sweep-SCENARIO-N]")
    ] = None,
    resume: Resume = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    json: Json = False,
) -> None:
    """Run a scenario at many values of its keys, and gather the results in one labelled store."""
    from cosim.run.folder import output_folder
    from scenarios.studies.sweep import Sweep, read_axis, run_sweep

    usual = count_workers(workers)
    axes = tuple(read_axis(text) for text in vary or ())
    asked = Sweep(
        scenario, axes, tuple(options.assignments or ()), samples, tolerance, options.seed
    )
    folder = output_folder(f"sweep-{Path(scenario).stem}", out, resume)
    progress = make_progress()
    try:
        document = run_sweep(
            asked, folder, device=options.device, workers=usual, scheduler=scheduler,
            resume=resume, progress=progress, metrics=metric or (),
        )  # fmt: skip
    finally:
        progress.close()
    if json:
        print_document(document)
    else:
        _print(document, folder)
    if document["failed"]:
        raise typer.Exit(1)


def _print(document: dict[str, Any], folder: Path) -> None:
    """Prints a table: the keys and the metrics of the figure."""
    from cosim.config.amounts import amount

    names = document["figure"]
    lines = [[*document["keys"], *names]]
    for row in document["rows"]:
        metrics = {} if row["result"] is None else row["result"]["metrics"]
        own = {} if row["result"] is None else {"error": row["result"]["error"] | {"unit": "1"}}
        cells = [(metrics | own).get(name) for name in names]
        lines.append([
            *row["values"],
            *("unknown" if cell is None or cell["value"] is None
              else amount(cell["value"], cell["unit"], 4) for cell in cells),
        ])  # fmt: skip
    widths = [max(len(line[n]) for line in lines) for n in range(len(lines[0]))]
    for line in lines:
        print(
            "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        )
    print(f"store   {folder / 'sweep.zarr'}")
    if names:
        print(f"figure  {folder / 'sweep.png'}")
