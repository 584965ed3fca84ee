"""`viform live`: the display of a scenario in a window, during the simulation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from cosim.run.shown import make_progress
from scenarios.cli.options import ScenarioName, ScenarioOptions, expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from cosim.run.progress import Progress
    from display import Window
    from scenarios.assemble.schema.scenario import Scenario

FRAME = 256
"""Number of cycles whose mean light is one picture in the window."""
BATCH = 64
"""Number of planes in a span."""


@expand_options
def live(
    options: ScenarioOptions,
    scenario: ScenarioName = "film",
    json: Json = False,
) -> None:
    """Show the display of a scenario in a window during the simulation (needs the extra view)."""
    from display import open_window
    from scenarios.assemble.behind.readout import refuse_readout
    from scenarios.assemble.pixel_kinds import refuse_beyond, refuse_leftovers
    from scenarios.assemble.schema.loading import filmed

    name, any_kind = options.load(scenario)
    loaded = filmed(any_kind, "live")
    refuse_leftovers(loaded)
    refuse_beyond(loaded, "viform live", "its window shows spikes of one size alone")
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


def show_live(
    scenario: Scenario, device: str | None, progress: Progress,
    open_window: Callable[[str, tuple[int, int]], Window],
) -> int:  # fmt: skip
    """Shows the whole run: scene, lens, camera, renderer, window. Every effect of the scenario is
    simulated, for any tolerance.

    Args:
        scenario: a scenario with latched pixels.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: receives progress.
        open_window: creates the window from a title and (height, width).

    Returns:
        The number of pictures shown until the end of the run, or until the user closes the window.

    Raises:
        InputError: other pixels, a board, or an invalid camera or device.
    """
    from cosim import InputError
    from cosim.report.png import for_display
    from cosim.stage import blocks
    from display import CameraPlane, fit_words, make_renderer, panel_views
    from display.section import DisplaySection
    from scenarios.assemble.source.latched.boards import refuse_boards
    from scenarios.assemble.source.latched.setup import set_up_camera
    from sensor import SpikeCamera

    if scenario.sensor.pixel != "latched":
        raise InputError(
            "sensor.pixel", "latched for viform live", scenario.sensor.pixel,
            "leave it out: the display is driven by the latch clock",
        )  # fmt: skip
    section = scenario.display or DisplaySection()
    refuse_boards(scenario)
    setup = set_up_camera(scenario, device)
    cycles = setup.cycles
    panel = section.panel(
        setup.shape, setup.setting.clock, setup.setting.row_skew, setup.white_rate
    )
    scene, lens = setup.stages(setup.source()).values()
    camera = SpikeCamera(setup.setting, setup.device)
    fit = fit_words(section.fit, setup.shape, panel.shape)
    window, pictures = open_window(scenario.title, panel.shape), 0
    renderer = None
    try:
        renderer = make_renderer(section.renderer, panel, BATCH, 1, window.context)
        progress.start(f"{cycles} cycles on {renderer.name}", cycles)
        for block in blocks(cycles, FRAME):
            spikes = camera.step(lens.step(scene.step(None, block), block), block)
            begin, end = (panel.start(n) for n in (block.start, block.stop))
            eye = CameraPlane(((begin + end) // 2,), end - begin)
            views = panel_views(eye, panel, block.start, block.cycles, BATCH)
            renderer.step(fit(spikes.words), block.cycles, views)
            if not window.show(for_display(renderer.take(0))):
                break
            pictures += 1
            progress.advance(block.stop)
    finally:
        if renderer is not None:
            renderer.close()
        window.close()
    return pictures
