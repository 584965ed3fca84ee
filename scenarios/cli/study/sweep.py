"""`viform sweep`: a scenario over values of its keys."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from scenarios.cli.options import ScenarioName, ScenarioOptions, Tolerance, expand_options
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
    resume: Annotated[
        bool, typer.Option("--resume", help="continue the interrupted sweep in --out")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(help="processes on this machine [one for two cores]")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="address of a Dask scheduler, for its workers instead")
    ] = None,
    json: Json = False,
) -> None:
    """Run a scenario at many values of its keys, and gather the results in one labelled store."""
    from cosim.compute.cores import cores
    from cosim.run.folder import output_folder
    from cosim.run.workers import check_workers
    from scenarios.studies.sweep import Sweep, read_axis, run_sweep

    check_workers(workers)
    axes = tuple(read_axis(text) for text in vary or ())
    asked = Sweep(
        scenario, axes, tuple(options.assignments or ()), samples, tolerance, options.seed
    )
    folder = output_folder(f"sweep-{Path(scenario).stem}", out, resume)
    usual = max(cores() // 2, 1)  # a run uses two cores
    progress = make_progress()
    try:
        document = run_sweep(
            asked, folder, device=options.device, workers=workers or usual, scheduler=scheduler,
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
