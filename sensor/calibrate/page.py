"""The folder of a calibration: result.json, report.html with its summary and figures, and
camera.toml, the preset of the calibrated camera, which `sensor.preset` takes.
"""

from __future__ import annotations

import html
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomli_w

from cosim.config.amounts import count, elapsed, number, percent
from cosim.config.quantity import Quantity
from cosim.files.atomic import atomic_write
from cosim.report.drawn import Data, Value, write_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from cosim.report.page import write_page
from cosim.report.parts import Card, cards, plot, table
from cosim.report.summary import Answer, big, listed, paragraph, summary
from cosim.run.result import dumps, viform_version
from sensor.calibrate.calibration import Calibration
from sensor.calibrate.histograms import Histogram
from sensor.calibrate.known import Parameter
from sensor.calibrate.twin import FILMS, LEVEL, Twin, compare_twin
from sensor.device.pattern import CORRELATED
from sensor.latched.sampling import MOST_JITTER

_BLUE: Final = "#2f5fa8"
_SHOWN: Final = 1e-7
"""Least share of the intervals that the axis shows."""


def intervals_figure(histograms: tuple[Histogram, ...], path: Path) -> Data:
    """Draws a column for each recording: above the shares of intervals, logarithmic, bars for the
    recording and dots for the model; below the difference over the share.

    Args:
        histograms: one or more.
        path: path of the PNG file.

    Returns:
        What was drawn: the intervals of recording and model, and how many of them.
    """
    wide = len(histograms)
    figure, axes = subplots(
        2, wide, figsize=(max(4.4 * wide, 5.4), 5.2), layout="constrained", squeeze=False,
        height_ratios=[2.2, 1],
    )  # fmt: skip
    rows: list[tuple[Value, ...]] = []
    for column, each in enumerate(histograms):
        total = each.measured.sum()
        shares, model = each.measured / total, each.model / total
        seen = np.flatnonzero(np.maximum(shares, model)[:-1] > _SHOWN)
        first, last = int(seen[0]), int(seen[-1]) + 1
        cycles = np.arange(first + 1, last + 1)
        rows += [
            (Path(each.name).name, float(n), float(each.measured[n - 1]), float(each.model[n - 1]))
            for n in cycles
        ]
        top, below = axes[:, column]
        top.bar(cycles, shares[first:last], width=0.85, color=_BLUE, alpha=0.55, label="recording")
        top.plot(cycles, model[first:last], "o", color=MARK, markersize=4, label="model")
        top.set_yscale("log")
        top.set_ylim(_SHOWN, 2)
        chance = f"p = {each.chance:.2g}" if each.chance > 1e-4 else "p < 0.0001"
        top.set_title(
            f"{Path(each.name).name}, {each.rate:.3g} spikes a cycle\nchi-square "
            f"{each.chi_square:.1f} for {each.bins} bins, {chance}", fontsize=9, color=INK,
        )  # fmt: skip
        error = 3 * np.sqrt(np.maximum(model[first:last], _SHOWN) / total)
        below.fill_between(cycles, -error * 1e2, error * 1e2, color=LINE, step="mid",
                           label="3 sqrt(count)")  # fmt: skip
        below.plot(cycles, (shares - model)[first:last] * 1e2, "o", color=MARK, markersize=3)
        below.axhline(0, color=INK, linewidth=0.6)
        below.set_xlabel("interval, cycles", fontsize=9, color=INK)
        for ax in (top, below):
            ax.spines[["top", "right"]].set_visible(False)
            ax.spines[["left", "bottom"]].set_color(LINE)
            ax.tick_params(colors=INK, labelsize=8)
            ax.xaxis.get_major_locator().set_params(integer=True)
            ax.set_xlim(first + 0.4, last + 0.6)
    axes[0, 0].set_ylabel("share of intervals", fontsize=9, color=INK)
    axes[1, 0].set_ylabel("recording less model, %", fontsize=9, color=INK)
    for row in axes[:, 0]:
        row.legend(fontsize=8, frameon=False)
    write_figure(figure, path)
    return Data(("recording", "interval, cycles", "intervals", "intervals of the model"), rows)


_MOST = 2e6
"""Largest threshold of a scenario, electrons."""


def preset_text(result: Calibration) -> str | None:
    """The file as TOML; None if the recordings do not show the temporal noise.

    What is not known is left out, or taken so that the recordings are reproduced: without a dark
    recording all of the spread in light is PRNU, and a threshold that is not known is the least
    that the noise allows. Comments say so.
    """
    found = result.parameters
    noise = found["interval_noise"].value
    if not isinstance(noise, float):
        return None
    lines = ["A camera by `viform calibrate`, with limits of 95 %. Use: sensor.preset."]
    threshold = found["threshold"].value
    if not isinstance(threshold, float):
        threshold = min(1 / noise**2 if noise else math.inf, _MOST)
        lines.append(
            "threshold: not known; this is the least that the noise allows, all of it shot noise"
        )
    noise = max(noise, threshold**-0.5)
    sensor: dict[str, Any] = {
        "width": result.shape[1], "height": result.shape[0],
        "clock": Quantity("frequency").write(result.clock.hz),
        "threshold": Quantity("charge").write(threshold),
    }  # fmt: skip
    if found["reset"].known:
        sensor["reset"] = found["reset"].value
    dead = found["dead_time"].value
    if isinstance(dead, float):
        sensor["dead_time"] = Quantity("time").write(min(dead, 1 / result.clock.hz))
    if result.duplicated:
        sensor["duplicated_rows"] = [list(pair) for pair in result.duplicated]
    for name in ("drift", "row_jitter", "row_band", "row_band_width"):
        value = found[name].value if name in found else None
        if isinstance(value, float) and (name != "drift" or value):
            most = {"row_jitter": MOST_JITTER, "drift": 0.1}.get(name, value)  # those of the keys
            sensor[name] = min(value, most)
    pattern: dict[str, Any] = {}
    of_threshold: dict[str, Any] = {"interval_noise": noise}
    for names, section in (
        (("prnu", "threshold_fpn", "dsnu", "hot_pixels", "dead_pixels"), pattern),
        (("dark_current", "hot_current"), of_threshold),
    ):
        for name in names:
            value = found[name].value if name in found else None
            if isinstance(value, float):  # estimates of a share, also beyond what a key may be
                section[name] = min(value, 1.0) if section is pattern else value
    if "prnu" not in pattern and "gain_spread" in found:
        spread = found["gain_spread"].value
        if isinstance(spread, float):
            pattern["prnu"] = min(spread, 1.0)
            lines.append("PRNU and spread of the threshold are not told apart: prnu is both")
    pattern |= _lines_of(found, pattern)
    if pattern.get("hot_pixels") and "hot_current" not in of_threshold:
        del pattern["hot_pixels"]
    lines += [
        f"{p.name}: {p.text}" if p.known else f"{p.name}: not known; {p.why}"
        for p in found.values()
    ]
    sensor["pattern"] = pattern
    head = "".join(f"# {line}\n" for line in lines)
    return head + tomli_w.dumps({"sensor": sensor, "of_threshold": of_threshold})


def _lines_of(found: dict[str, Parameter], pattern: dict[str, Any]) -> dict[str, Any]:
    """Keys of rows, columns and neighbours, and the PRNU that is left beside rows and columns."""

    def value(name: str) -> float:
        given = found[name].value if name in found else None
        return given if isinstance(given, float) else 0.0

    prnu, lines = pattern.get("prnu", 0.0), {n: value(n) for n in ("row_fpn", "column_fpn")}
    left = prnu**2 - lines["row_fpn"] ** 2 - lines["column_fpn"] ** 2
    out: dict[str, Any] = {name: size for name, size in lines.items() if size}
    if left <= 0:
        return out
    if out:
        out["prnu"] = left**0.5
    for name in ("neighbours_in_row", "neighbours_in_column"):
        alike = value(name) * max(value("gain_spread") ** 2 / left, 1.0)
        if alike:
            out[name] = min(alike, CORRELATED)
    return out


_MAIN: Final = ("interval_noise", "threshold", "prnu", "dark_current", "dead_time")
"""Parameters with a card of their own, if they are known."""
_ROLES: Final = {
    "flat": "constant uniform light", "scene": "a scene at rest", "moving": "changing light",
    "dark": "darkness", "saturated": "light too bright to be used",
}  # fmt: skip


def _sentence(twin: Twin) -> str:
    """What the twin's films say, as a sentence."""
    return twin.verdict[0].upper() + twin.verdict[1:] + "."


def answers(result: Calibration, seconds: float, twin: Twin | None) -> list[Answer]:
    """The answers for a newcomer. seconds: that the calibration took; twin: None without a film."""
    used = listed(f"{name}: {_ROLES[role]}" for name, role in result.roles.items())
    done = (
        "The parameters of the pixel's model were estimated from spikes alone, with limits that "
        "hold the true value with 95 % confidence. The recordings show:"
    )
    return [
        ("What was calibrated", paragraph(done) + used),
        ("How well the camera is known", cards(_cards(result))),
        ("How wrong it may be", _wrong(result, twin)),
        ("How long it took", big(elapsed(seconds), "Reading and fits.")),
        ("What was left out", _left_out(result)),
        ("Notes", listed(result.notes)),
    ]


def _cards(result: Calibration) -> list[Card]:
    found = result.parameters
    known = sum(p.known for p in found.values())
    rows: list[Card] = [("first", f"{count(known)} of {count(len(found))}", "parameters are known")]
    for name in _MAIN:
        if name in found and found[name].known:
            value, _, limits = found[name].text.partition(", ")
            rows.append(("", value, found[name].title + (f" ({limits})" if limits else "")))
    return rows


def _wrong(result: Calibration, known: Twin | None) -> str:
    twin = "" if known is None or known.told_by else f"{_sentence(known)} "  # else in the list
    limits = "The limits of each parameter are in the tables. "
    if not result.histograms:
        constant = {"flat", "scene"} & set(result.roles.values())
        return paragraph(limits + twin + (
            "Too few intervals are of constant light and of rows without timing noise, so those of "
            "the model were not compared with them." if constant else
            "No recording is of constant light, so the model could not be compared with one."
        )) + listed(result.does_not_fit)  # fmt: skip
    off = max(histogram.off for histogram in result.histograms)
    text = (
        "of the intervals of a recording are longer or shorter than in the model with these "
        "parameters, in the recording where it fits worst. " + limits + twin
    )
    if result.does_not_fit:
        text += "Beyond chance, the model does not explain: "
    else:
        text += "All deviations are within chance."
    return big(percent(off, 2), text.strip()) + listed(result.does_not_fit)


def _left_out(result: Calibration) -> str:
    unknown = [p.title for p in result.parameters.values() if not p.known]
    bright = [name for name, role in result.roles.items() if role == "saturated"]
    text = "Nothing: every parameter is known."
    if unknown:
        text = (
            f"What these recordings cannot tell: {'; '.join(unknown)}. A table says why, and what "
            "would make each known."
        )
    if bright:
        text += f" Recordings too bright to be used: {', '.join(bright)}."
    return paragraph(text)


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
        with atomic_write(folder / "camera.toml") as part:
            part.write_text(preset, encoding="utf-8")
        files.append("camera.toml")
    twin = None
    if preset is not None and result.still is not None:
        twin = compare_twin(*result.still, folder / "camera.toml")
        if told := twin.told_by:
            line = f"films of the preset: they differ from the recording in {', '.join(told)}"
            result = replace(result, does_not_fit=(*result.does_not_fit, line))
    data = None
    if result.histograms:
        data = intervals_figure(result.histograms, folder / _FIGURE)
        files.append(_FIGURE)
    head = summary(
        _TITLE,
        f"{result.shape[1]} x {result.shape[0]} pixels at {number(result.clock.hz / 1e3)} kHz, "
        f"viform {viform_version()}; limits hold with 95 % confidence",
        answers(result, time.perf_counter() - began, twin),
    )  # fmt: skip
    write_page(folder, _TITLE, head, _sections(result, folder, preset, data, twin))
    document = {"version": viform_version(), **result.document(),
                "twin": None if twin is None else twin.document(),
                "files": [*files, "report.html", "result.json"]}  # fmt: skip
    with atomic_write(folder / "result.json") as part:
        part.write_text(dumps(document) + "\n", encoding="utf-8")
    return document


def _sections(
    result: Calibration, folder: Path, preset: str | None, data: Data | None, twin: Twin | None
) -> str:  # fmt: skip
    """HTML of the sections. data: what the figure shows, None without one; twin: the comparison of
    the preset with the recording, None without one."""
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
        ]
    if result.histograms or fits:
        body += [
            "<h2>What does not fit</h2>",
            fits or "<p>Nothing: all deviations are within chance.</p>",
        ]
    if twin is not None:
        rows = [
            [each.name, number(each.recording, 3), number(each.twin, 3), number(each.spread, 2),
             number(each.chance, 2), "told" if each.told else ""]
            for each in twin.statistics
        ]  # fmt: skip
        body += [
            "<h2>The twin beside the recording</h2>",
            f"<p>The preset was filmed {FILMS} times under the recording's light, with other seeds "
            f"and devices, {count(twin.cycles)} cycles each. p is the chance that one more film is "
            f"as far away as the recording; all are judged together at {percent(LEVEL)}. "
            f"{html.escape(_sentence(twin))}</p>",
            table(["statistic", "recording", "twin", "spread of its films", "p", ""], rows),
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
