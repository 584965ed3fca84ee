"""The page of a recorded stream: its images, without truth."""

from __future__ import annotations

import time

from cosim import Clock
from cosim.report.parts import cards, figure, table
from cosim.report.png import for_display
from cosim.run.machine import Page, Run

__all__ = ["recording_page"]


def recording_page(title: str, clock: Clock, run: Run, facts: list[list[str]]) -> Page:
    """The page.

    Args:
        title: title of the scenario.
        clock: of the stream.
        run: the run; its views are the images (TFP, TFI) by cycle, white = 1.
        facts: rows of the table of the recording: what, value, from.
    """
    metrics, shots = run.result.metrics, run.outcome.views
    spent = time.perf_counter() - run.began
    rate = metrics["spike_rate"].value
    head = cards([
        ("first", f"{spent:.1f} s", f"run time, for {run.result.simulated_s * 1e3:.4g} ms"),
        ("first", f"{rate:.3g}", "spikes a pixel and cycle"),
    ])  # fmt: skip
    parts = [
        "<h2>Images at chosen instants</h2><p>TFP and TFI of the recorded spikes, white of the "
        "notes = white, through the sRGB curve. A recording has no true light to compare with.</p>"
    ]
    for cycle, (mean, interval) in shots.items():
        pictures = figure(for_display(mean), "TFP") + figure(for_display(interval), "TFI")
        parts.append(
            f'<div class="row-title">{clock.middle(cycle) / 1e9:.3f} ms</div>'
            f'<div class="grid by2">{pictures}</div>'
        )
    return Page(
        title,
        "a recorded stream",
        head,
        ["".join(parts), "<h2>The recording</h2>" + table(["what", "value", "from"], facts)],
    )
