"""The commands of many runs: a scenario over values of its keys (`viform sweep`), and many scenes
through many cameras, with their truth (`viform dataset`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.run.shown import make_progress
from scenarios.cli.options import (
    Draws,
    Resume,
    ScenarioName,
    ScenarioOptions,
    Scheduler,
    Tolerance,
    Workers,
    count_workers,
    expand_options,
)
from scenarios.cli.output import Json, print_document, tell


@dataclass(frozen=True)
class BatchOptions(ScenarioOptions):
    """Options of a batch of runs."""

    tolerance: Tolerance = None
    draws: Draws = None
    out: Annotated[
        Path | None, typer.Option(help="folder to create [the first free one in runs/]")
    ] = None
    resume: Resume = False
    workers: Workers = None
    scheduler: Scheduler = None
    json: Json = False

    @property
    def given(self) -> tuple[str, ...]:
        """Keys that are the same for all runs, as assignments."""
        draws = () if self.draws is None else (f"draws={self.draws}",)
        return (*(self.assignments or ()), *draws)

    def make(
        self, name: str, build: Callable[..., dict[str, Any]],
        show: Callable[[dict[str, Any], Path], None],
    ) -> None:  # fmt: skip
        """Makes a batch and prints its document; ends with exit code 1 if a run of it failed.

        Args:
            name: name of the folder in runs/.
            build: makes it; called with the folder, and device, workers, scheduler, resume and
                progress by name.
            show: prints the document, with the folder, as text.

        Raises:
            InputError: an option cannot be used.
        """
        from cosim.run.folder import output_folder

        workers = count_workers(self.workers)
        folder = output_folder(name, self.out, self.resume)
        progress = make_progress()
        try:
            document = build(
                folder, device=self.device, workers=workers, scheduler=self.scheduler,
                resume=self.resume, progress=progress,
            )  # fmt: skip
        finally:
            progress.close()
        if self.json:
            print_document(document)
        else:
            show(document, folder)
        if document["failed"]:
            raise typer.Exit(1)


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
    asked = Sweep(scenario, axes, options.given, samples, options.tolerance, options.seed)
    build = partial(run_sweep, asked, metrics=metric or ())
    options.make(f"sweep-{Path(scenario).stem}", build, _print_points)


def _print_points(document: dict[str, Any], folder: Path) -> None:
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


@expand_options
def dataset(
    source: Annotated[
        list[str] | None,
        typer.Argument(help="scenarios of `viform list`, TOML files, clips, folders of clips"),
    ] = None,
    camera: Annotated[
        list[str] | None,
        typer.Option(help="a chip, or a TOML file with a [sensor] [that of the scenario]"),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=RANGE", help="lo:hi; lo:hi:log; lo:hi:int; a,b,c"),
    ] = None,
    samples: Annotated[int, typer.Option(help="scenes of each source")] = 1,
    split: Annotated[str, typer.Option(help="shares of train, val and test")] = ".8,.1,.1",
    check: Annotated[
        int, typer.Option(help="an item of so many is measured against full physics; 0 for none")
    ] = 100,
    *,
    options: BatchOptions,
) -> None:
    """Film many scenes with many cameras: streams, true light, and dense truth of drawn objects."""
    from scenarios.studies.dataset.build import build_dataset, order_of

    order = order_of(
        source or (), camera or (), vary or (), options.given, samples, split,
        options.seed, options.tolerance, check,
    )  # fmt: skip
    options.make("dataset", partial(build_dataset, order), _print_items)


def _print_items(document: dict[str, Any], folder: Path) -> None:
    for split, names in document["splits"].items():
        tell(f"{split:<6} {len(names)} items")
    if document["failed"]:
        tell(f"left out {document['failed']} of {document['items']} items")
    tell(f"card   {folder}/README.md")
    tell(f"sums   {folder}/SHA256SUMS")
