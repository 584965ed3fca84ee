"""What the commands of many runs share: options, and the frame from the folder to the exit code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.run.shown import make_progress
from scenarios.cli.options import (
    Resume,
    ScenarioOptions,
    Scheduler,
    Tolerance,
    Workers,
    count_workers,
)
from scenarios.cli.output import Json, print_document


@dataclass(frozen=True)
class BatchOptions(ScenarioOptions):
    """Options of a batch of runs."""

    tolerance: Tolerance = None
    out: Annotated[
        Path | None, typer.Option(help="folder to create [the first free one in runs/]")
    ] = None
    resume: Resume = False
    workers: Workers = None
    scheduler: Scheduler = None
    json: Json = False

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
