"""`viform live`: a scenario's display in a window, as it is simulated."""

from __future__ import annotations

from typing import Annotated

import typer

from scenarios.cli.output import Json, make_progress, print_document

__all__ = ["live"]


def live(
    scenario: Annotated[
        str, typer.Argument(help="a name from `viform list`, a TOML file, or the folder of a run")
    ] = "film",
    assignments: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="override a key")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="of all temporal noise")] = None,
    device: Annotated[
        str | None, typer.Option(help="part of an OpenCL device's name, or numba")
    ] = None,
    json: Json = False,
) -> None:
    """Show a scenario's display in a window while it is filmed (needs the extra view)."""
    from display import open_window
    from scenarios.assemble.readout import refuse_leftovers
    from scenarios.assemble.schema.loading import filmed, load
    from scenarios.cli.window import show_live

    name, given = load(scenario, assignments, seed=seed)
    loaded = filmed(given, "live")
    refuse_leftovers(loaded)
    progress = make_progress()
    try:
        shown = show_live(loaded, device, progress, open_window)
    finally:
        progress.close()
    if json:
        print_document({"scenario": name, "pictures": shown})
    else:
        print(f"{shown} pictures of {name} were shown")
