"""`viform sweep`: a scenario over values of its keys."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from scenarios.cli.options import ScenarioName, expand_options
from scenarios.cli.output import tell
from scenarios.cli.study.batch import BatchOptions


@expand_options
def sweep(
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
    *,
    options: BatchOptions,
) -> None:
    """Run a scenario at many values of its keys, and gather the results in one labelled store."""
    from scenarios.studies.sweep import Sweep, read_axis, run_sweep

    axes = tuple(read_axis(text) for text in vary or ())
    asked = Sweep(
        scenario, axes, tuple(options.assignments or ()), samples, options.tolerance, options.seed
    )
    build = partial(run_sweep, asked, metrics=metric or ())
    options.make(f"sweep-{Path(scenario).stem}", build, _print)


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
        tell(
            "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        )
    tell(f"store   {folder / 'sweep.zarr'}")
    if names:
        tell(f"figure  {folder / 'sweep.png'}")
