"""`viform dataset`: many scenes through many cameras, with their truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from scenarios.cli.options import (
    Resume,
    ScenarioOptions,
    Scheduler,
    Tolerance,
    Workers,
    count_workers,
    expand_options,
)
from scenarios.cli.output import Json, make_progress, print_document

__all__ = ["dataset"]


@expand_options
def dataset(
    options: ScenarioOptions,
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
    tolerance: Tolerance = None,
    out: Annotated[Path | None, typer.Option(help="folder to create [runs/dataset-N]")] = None,
    resume: Resume = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    json: Json = False,
) -> None:
    """Film many scenes with many cameras: streams, true light, and dense truth of drawn objects."""
    from cosim.run.folder import output_folder
    from scenarios.studies.dataset.build import build_dataset
    from scenarios.studies.dataset.making import order_of

    usual = count_workers(workers)
    order = order_of(
        source or (), camera or (), vary or (), options.assignments or (), samples, split,
        options.seed, tolerance,
    )  # fmt: skip
    folder = output_folder("dataset", out, resume)
    progress = make_progress()
    try:
        document = build_dataset(
            order, folder, device=options.device, workers=usual, scheduler=scheduler,
            resume=resume, progress=progress,
        )  # fmt: skip
    finally:
        progress.close()
    if json:
        print_document(document)
    else:
        _print(document)
    if document["failed"]:
        raise typer.Exit(1)


def _print(document: dict[str, Any]) -> None:
    for split, names in document["splits"].items():
        print(f"{split:<6} {len(names)} items")
    if document["failed"]:
        print(f"left out {document['failed']} of {document['items']} items")
    print(f"card   {document['folder']}/README.md")
    print(f"sums   {document['folder']}/SHA256SUMS")
