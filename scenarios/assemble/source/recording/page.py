"""The page of a recorded stream: its images, without truth."""

from __future__ import annotations

from cosim import Clock
from cosim.config.amounts import amount, number
from cosim.report.parts import figure, table
from cosim.report.png import for_display
from cosim.run.machine import Page, Run


def recording_page(
    title: str, clock: Clock, run: Run, facts: list[list[str]], explorer: str
) -> Page:
    """The page.

    Args:
        title: title of the scenario.
        clock: clock of the stream.
        run: the run; its views are the images (TFP, TFI) by cycle, white = 1.
        facts: rows of the table of the recording: what, value, from.
        explorer: explorer of the stream's spikes.
    """
    metrics, shots = run.result.metrics, run.outcome.views
    rate = number(metrics["spike_rate"].value)
    length = amount(run.result.simulated_s, "s", 4)
    parts = [
        "<h2>Images at chosen instants</h2><p>TFP and TFI of the recorded spikes, white of the "
        "notes = white, through the sRGB curve. A recording has no true light to compare with.</p>"
    ]
    for cycle, (mean, interval) in shots.items():
        pictures = figure(for_display(mean), "TFP") + figure(for_display(interval), "TFI")
        parts.append(
            f"<h3>{number(clock.middle(cycle) / 1e9, 4)} ms</h3>"
            f'<div class="grid by2">{pictures}</div>'
        )
    return Page(
        title,
        "a recorded stream",
        f"No camera was simulated: these spikes were recorded, {length} of them. The images below "
        "are computed from them.",
        [("first", rate, "spikes per pixel and cycle, mean")],
        [
            f"<h2>Explore the stream</h2>{explorer}",
            "".join(parts),
            "<h2>The recording</h2>" + table(["what", "value", "from"], facts),
        ],
        good="What the recording holds",
        quality="No image can be rated: a recording has no true light to compare with.",
        unmeasured="Nothing to be wrong: the spikes are those of the recording, bit by bit.",
    )
