"""`viform live`: the display of a scenario in a window, during the simulation."""

from __future__ import annotations

from cosim.run.shown import make_progress
from scenarios.cli.options import ScenarioName, ScenarioOptions, expand_options
from scenarios.cli.output import Json, print_document, tell


@expand_options
def live(
    options: ScenarioOptions,
    scenario: ScenarioName = "film",
    json: Json = False,
) -> None:
    """Show the display of a scenario in a window during the simulation (needs the extra view)."""
    from display import open_window
    from scenarios.assemble.behind.readout import refuse_readout
    from scenarios.assemble.readout import refuse_leftovers
    from scenarios.assemble.schema.loading import filmed
    from scenarios.cli.scenario.window import show_live

    name, any_kind = options.load(scenario)
    loaded = filmed(any_kind, "live")
    refuse_leftovers(loaded)
    refuse_readout(loaded, "live")
    progress = make_progress()
    try:
        pictures = show_live(loaded, options.device, progress, open_window)
    finally:
        progress.close()
    if json:
        print_document({"scenario": name, "pictures": pictures})
    else:
        tell(f"{pictures} pictures of {name} were displayed")
