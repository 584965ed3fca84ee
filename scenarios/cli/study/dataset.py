"""`viform dataset`: many scenes through many cameras, with their truth."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from scenarios.cli.options import expand_options
from scenarios.cli.output import tell
from scenarios.cli.study.batch import BatchOptions


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
    from scenarios.studies.dataset.build import build_dataset
    from scenarios.studies.dataset.making import order_of

    order = order_of(
        source or (), camera or (), vary or (), options.assignments or (), samples, split,
        options.seed, options.tolerance, check,
    )  # fmt: skip
    options.make("dataset", partial(build_dataset, order), _print)


def _print(document: dict[str, Any], folder: Path) -> None:
    for split, names in document["splits"].items():
        tell(f"{split:<6} {len(names)} items")
    if document["failed"]:
        tell(f"left out {document['failed']} of {document['items']} items")
    tell(f"card   {folder}/README.md")
    tell(f"sums   {folder}/SHA256SUMS")
