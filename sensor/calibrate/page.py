"""The folder of a calibration: result.json, camera.toml, figures and report.html."""

from __future__ import annotations

import html
import time
from pathlib import Path
from typing import Any, Final

from cosim.config.amounts import count, number, percent
from cosim.files.whole import whole
from cosim.report.drawn import Data
from cosim.report.page import write_page
from cosim.report.parts import plot, table
from cosim.report.summary import listed, summary
from cosim.run.result import dumps, viform_version
from sensor.calibrate.calibration import Calibration
from sensor.calibrate.figure import intervals_figure
from sensor.calibrate.preset import preset_text
from sensor.calibrate.summary import answers

_TITLE: Final = "Calibration of a spike camera"
_FIGURE: Final = "figures/intervals.png"


def write_calibration(result: Calibration, folder: Path, began: float) -> dict[str, Any]:
    """Writes the files into a folder, result.json last; returns its document.

    Args:
        result: the calibration.
        folder: exists.
        began: time.perf_counter() at the start of the command, for the page.

    `camera.toml` is written if the recordings tell the temporal noise, the figure if one of them is
    of constant light.
    """
    files = []
    preset = preset_text(result)
    if preset is not None:
        with whole(folder / "camera.toml") as part:
            part.write_text(preset, encoding="utf-8")
        files.append("camera.toml")
    data = None
    if result.histograms:
        data = intervals_figure(result.histograms, folder / _FIGURE)
        files.append(_FIGURE)
    head = summary(
        _TITLE,
        f"{result.shape[1]} x {result.shape[0]} pixels at {number(result.clock.hz / 1e3)} kHz, "
        f"viform {viform_version()}; limits hold with 95 % confidence",
        answers(result, time.perf_counter() - began),
    )  # fmt: skip
    write_page(folder, _TITLE, head, _sections(result, folder, preset, data))
    document = {"version": viform_version(), **result.document(),
                "files": [*files, "report.html", "result.json"]}  # fmt: skip
    with whole(folder / "result.json") as part:
        part.write_text(dumps(document) + "\n", encoding="utf-8")
    return document


def _sections(
    result: Calibration, folder: Path, preset: str | None, data: Data | None
) -> str:  # fmt: skip
    """HTML of the sections. data: what the figure shows, None without one."""
    known = [p for p in result.parameters.values() if p.known]
    unknown = [p for p in result.parameters.values() if not p.known]
    fits = listed(result.does_not_fit)
    body = [
        "<h2>Known</h2>",
        table(["parameter", "value and limits", "from"], [[p.title, p.text, p.why] for p in known])
        if known
        else "<p>No parameter: the recordings leave all of them open.</p>",
        "<h2>Not known, and why</h2>",
        table(
            ["parameter", "limits", "why", "what would make it known"],
            [[p.title, p.text or "none", p.why, p.remedy] for p in unknown],
        ),
    ]
    if result.histograms:
        rows = [
            [h.name, number(h.rate, 4), number(h.chi_square), count(h.bins), number(h.chance, 2),
             percent(h.off)]
            for h in result.histograms
        ]  # fmt: skip
        body += [
            "<h2>Intervals of recording and model</h2>",
            "<p>Every pixel has its measured mean interval; noise, skewness and dead time are "
            "those of the camera. The covariance of the difference is that of pixels.</p>",
            plot(folder / _FIGURE, "interval histograms of recording and model", data),
            table(["recording", "spikes a cycle", "chi-square", "bins", "p", "misplaced"], rows),
            "<h2>What does not fit</h2>",
            fits or "<p>Nothing: all deviations are within chance.</p>",
        ]
    body += [
        "<h2>Recordings</h2>",
        table(["recording", "used as"], [[name, role] for name, role in result.roles.items()]),
    ]
    if preset is not None:
        body += [
            "<h2>The preset</h2><p>For <code>sensor.preset</code>; keys of the scenario win.</p>",
            f"<pre>{html.escape(preset)}</pre>",
        ]
    return "".join(body)
