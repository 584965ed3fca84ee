"""`viform live`: a scenario's display in a window, as it is simulated."""

from __future__ import annotations

from scenarios.cli.options import ScenarioName, ScenarioOptions, expand_options
from scenarios.cli.output import Json, make_progress, print_document

__all__ = ["live"]


@expand_options
def live(
    options: ScenarioOptions,
    scenario: ScenarioName = "film",
    json: Json = False,
) -> None:
    """Show a scenario's display in a window while it is filmed (needs the extra view)."""
    from display import open_window
    from scenarios.assemble.readout import refuse_leftovers
    from scenarios.assemble.schema.loading import filmed
    from scenarios.cli.window import show_live

    name, given = options.load(scenario)
    loaded = filmed(given, "live")
    refuse_leftovers(loaded)
    progress = make_progress()
    try:
        shown = show_live(loaded, options.device, progress, open_window)
    finally:
        progress.close()
    if json:
        print_document({"scenario": name, "pictures": shown})
    else:
        print(f"{shown} pictures of {name} were shown")
