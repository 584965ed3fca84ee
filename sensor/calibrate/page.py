"""The folder of a calibration: result.json, camera.toml, figures and report.html."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any, Final

from cosim.files.whole import whole
from cosim.report.page import write_page
from cosim.report.parts import plot, table
from cosim.run.result import dumps, viform_version
from sensor.calibrate.calibration import Calibration
from sensor.calibrate.figure import intervals_figure
from sensor.calibrate.preset import preset_text

__all__ = ["write_calibration"]

_FIGURE: Final = "figures/intervals.png"


def write_calibration(result: Calibration, folder: Path) -> dict[str, Any]:
    """Writes the files into a folder, result.json last; returns its document.

    `camera.toml` is written if the recordings tell the temporal noise, the figure if one of them is
    of constant light.
    """
    files = []
    preset = preset_text(result)
    if preset is not None:
        with whole(folder / "camera.toml") as part:
            part.write_text(preset, encoding="utf-8")
        files.append("camera.toml")
    if result.histograms:
        (folder / "figures").mkdir(exist_ok=True)
        with whole(folder / _FIGURE) as part:
            intervals_figure(result.histograms, part)
        files.append(_FIGURE)
    _write_report(result, folder, preset)
    document = {"version": viform_version(), **result.document(),
                "files": [*files, "report.html", "result.json"]}  # fmt: skip
    with whole(folder / "result.json") as part:
        part.write_text(dumps(document) + "\n", encoding="utf-8")
    return document


def _write_report(result: Calibration, folder: Path, preset: str | None) -> None:
    known = [p for p in result.parameters.values() if p.known]
    unknown = [p for p in result.parameters.values() if not p.known]
    fits = "".join(f"<li>{html.escape(line)}</li>" for line in result.does_not_fit)
    notes = "".join(f"<li>{html.escape(line)}</li>" for line in result.notes)
    head = (
        "<h1>Calibration of a spike camera</h1>"
        f'<p class="soft">{result.shape[1]} x {result.shape[0]} pixels at '
        f"{result.clock.hz / 1e3:g} kHz, viform {html.escape(viform_version())}. Limits hold at "
        f"95 %.</p><ul>{notes}</ul>"
    )
    body = [
        "<h2>Known</h2>",
        table(["parameter", "value and limits", "from"], [[p.title, p.text, p.why] for p in known]),
        "<h2>Not known, and why</h2>",
        table(
            ["parameter", "limits", "why", "what would make it known"],
            [[p.title, p.text, p.why, p.remedy] for p in unknown],
        ),
    ]
    if result.histograms:
        rows = [
            [h.name, f"{h.rate:.4g}", f"{h.chi_square:.1f}", str(h.bins), f"{h.chance:.3g}",
             f"{h.off:.3%}"]
            for h in result.histograms
        ]  # fmt: skip
        body += [
            "<h2>Intervals of recording and model</h2>",
            "<p>Every pixel has its measured mean interval; noise, skewness and dead time are "
            "those of the camera. The covariance of the difference is that of pixels.</p>",
            plot(folder / _FIGURE, "interval histograms"),
            table(["recording", "spikes a cycle", "chi-square", "bins", "p", "misplaced"], rows),
            "<h2>What does not fit</h2>",
            f"<ul>{fits}</ul>" if fits else "<p>Nothing: all deviations are within chance.</p>",
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
    write_page(folder, "Calibration of a spike camera", head, "".join(body))
