"""The page of a run of a continuous camera."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import amount, count, decibel, number, percent
from cosim.report.figures import overview_figure
from cosim.report.parts import Card, figure, plot, table
from cosim.report.pictures import mark_pixels
from cosim.report.png import for_display, write_png
from cosim.run.machine import Page
from sensor.continuous.explored import reports_explorer
from sensor.continuous.figures import pixels_figure, rate_figure
from sensor.continuous.run import STREAM, ContinuousRun
from sensor.sections.continuous import ContinuousSection
from sensor.sections.provenance import fault_rows, optics_rows


def _cards(judged: ContinuousRun) -> list[Card]:
    metrics, raw = judged.run.result.metrics, judged.spec.setting.clock.hz
    return [
        ("first", decibel(metrics["continuous_psnr"].value),
         f"PSNR against the true light; SSIM {number(metrics['continuous_ssim'].value)}"),
        ("", number(metrics["report_rate"].value), "reports a pixel and second"),
        ("", count(metrics["bit_rate"].value),
         f"bits a pixel and second; spikes latched at this clock: {count(raw)}"),
    ]  # fmt: skip


def _simulated(judged: ContinuousRun) -> str:
    """What was simulated, for a newcomer."""
    height, width = judged.views.reports.shape
    return (
        f"A camera with {width} x {height} pixels, the {judged.spec.setting.chip.title}, watches "
        f"the scene “{judged.spec.title}” for {amount(judged.run.result.simulated_s, 's', 4)}. "
        "Every pixel watches its own light and reports its value whenever that has changed by more "
        f"than {percent(judged.spec.setting.contrast)}; what stands still is not sent again."
    )


def _counts(judged: ContinuousRun) -> npt.NDArray[np.int64]:
    """Reports of each pixel, (H, W)."""
    height, width = judged.views.reports.shape
    return np.bincount(judged.views.reports.pixel, minlength=height * width).reshape(height, width)


def _where(counts: npt.NDArray[np.int64]) -> Any:
    """Reports of each pixel as a picture: black none, white the most, logarithmic."""
    return np.rint(255 * np.log1p(counts) / np.log1p(max(int(counts.max()), 1))).astype(np.uint8)


def _images(judged: ContinuousRun, counts: npt.NDArray[np.int64]) -> str:
    ms = 1e3 / judged.spec.setting.clock.hz
    middle = judged.views.shots[len(judged.views.shots) // 2]
    overview_figure(
        [
            (f"true light at {number((middle.cycle + 0.5) * ms, 4)} ms", for_display(middle.truth)),
            ("last report of every pixel", for_display(middle.continuous)),
            (f"reports of each pixel, to {count(counts.max())}", _where(counts)),
        ],
        judged.run.folder / "figures" / "overview.png",
    )
    parts = [
        "<h2>Images at chosen instants</h2><p>True light in the middle of the cycle, and the last "
        "value that every pixel has reported by its end, white of the scene = white, through the "
        "sRGB curve. The linear pictures are in <code>images/</code>.</p>"
    ]
    for shot in judged.views.shots:
        ages = shot.age[shot.age >= 0] * ms
        old = "none"
        if ages.size:
            old = f"median {number(np.median(ages))}, oldest {number(ages.max(), 4)} ms"
        pictures = figure(for_display(shot.truth), "true light") + figure(
            for_display(shot.continuous), f"last reports; their age: {old}"
        )
        parts.append(
            f"<h3>cycle {count(shot.cycle)}, "
            f"{number((shot.cycle + 0.5) * ms, 4)} ms</h3>"
            f'<div class="grid by2">{pictures}</div>'
        )
    return "".join(parts)


def _pixels(judged: ContinuousRun, counts: npt.NDArray[np.int64]) -> str:
    figures, points = judged.run.folder / "figures", judged.views.light.points
    data = pixels_figure(
        judged.views.reports, judged.views.light, judged.spec.setting.electrons_per_lux,
        judged.spec.white, [shot.cycle for shot in judged.views.shots], figures / "intensities.png",
    )  # fmt: skip
    middle = judged.views.shots[len(judged.views.shots) // 2]
    marks = mark_pixels(for_display(middle.continuous), points)
    write_png(figures / "pixels.png", marks)
    pair = figure(marks, f"the pixels, on the image of cycle {middle.cycle}") + figure(
        _where(counts),
        f"reports of each pixel: {count(counts.min())} to {count(counts.max())}, logarithmic",
    )
    return (
        "<h2>Single pixels</h2><p>Between its reports a pixel's current is taken to stand still: "
        "what it puts out is a piecewise constant form of its light (Huang 2022, section 3.1). The "
        "true light is what falls on the pixel, behind lens and cross-talk, before its own gain "
        "and dark current.</p>"
        + plot(
            figures / "intensities.png",
            "reports of single pixels over time, and their true light",
            data,
        )
        + f'<div class="grid by2">{pair}</div>'
    )


def _traffic(judged: ContinuousRun) -> str:
    reports, path = judged.views.reports, judged.run.folder / "figures" / "reports.png"
    pixels = reports.shape[0] * reports.shape[1]
    _, first = np.unique(reports.pixel, return_index=True)
    later = np.ones(len(reports), bool)
    later[first] = False
    data = rate_figure(reports.time[later], reports.ticks, pixels, reports.clock, path)
    rows_bits, column_bits = (max(n - 1, 1).bit_length() for n in reports.shape)
    bits, setting = judged.run.result.metrics["bit_rate"].value or 0.0, judged.spec.setting
    rows = [
        ["reports", count(len(reports))],
        ["of them after each pixel's first", count(int(later.sum()))],
        ["reports/s a pixel", number(judged.run.result.metrics["report_rate"].value, 4)],
        ["bits of a report",
         f"{rows_bits} row + {column_bits} column + {setting.converter.bits} value = "
         f"{setting.report_bits}; its time is when it is sent"],
        ["bits/s a pixel", count(bits)],
        ["spikes latched at this clock, bits/s a pixel",
         count(setting.clock.hz)
         + (f", {number(setting.clock.hz / bits)} times as many" if bits else "")],
    ]  # fmt: skip
    rows += [
        [f"{row.stage} at the instants", ", ".join(
            f"{amount(us * 1e-6, 's', 4)} {name}"
            for name, us in (("min", row.min_us), ("median", row.median_us), ("max", row.max_us))
        )]
        for row in judged.run.result.latency
    ]  # fmt: skip
    return (
        "<h2>Reports</h2><p>Every pixel reports at the start; these first reports are left out of "
        "the figure and counted in the table. A shared output is taken to be fast enough: reports "
        "do not wait. A report's age is no delay: what has not changed is not reported again.</p>"
        + plot(path, "reports a pixel and second over time", data)
        + table(["what", "value"], rows)
        + f'<pre>reports = numpy.load("{STREAM}")   # row, column, time (ticks), value '
        "(electrons/s)</pre>"
    )


def _machine(judged: ContinuousRun) -> str:
    spec = judged.spec
    setting, chip, section = spec.setting, spec.setting.chip, spec.section.continuous
    assert section is not None
    plain = ContinuousSection()

    def ground(*names: str) -> str:
        same = all(getattr(section, n) == getattr(plain, n) for n in names)
        return "assumed: the default" if same else "scenario"

    converter, share = setting.converter, setting.floor / spec.white
    full = "1e5 lux at QE 0.7, Huang 2022 section 4.3"
    numbers = [
        ["pixels", f"{chip.width} x {chip.height}",
         "scenario" if section.width or section.height else chip.size_origin],
        ["report clock", f"{number(setting.clock.hz / 1e3)} kHz", "scenario"],
        ["monitor's time constant", f"{number(setting.time_constant * 1e3)} ms",
         ground("time_constant")],
        ["change reported, of the last report", number(setting.contrast), ground("contrast")],
        ["but at least", f"{number(setting.floor)} e/s, {number(share, 2)} of white",
         "6 deviations of shot noise at any light" if section.floor is None else "scenario"],
        ["measuring time", f"{number(setting.measure * 1e3)} ms" if setting.measure else
         "0: the filter is read", ground("measure")],
        ["dead time after a report", f"{number(setting.dead_time * 1e3)} ms", ground("dead_time")],
        ["converter", f"{converter.bits} bits, {converter.exponent_bits} of them an exponent",
         ground("bits", "exponent_bits")],
        ["its full scale, smallest step",
         f"{number(converter.full_scale)}, {number(converter.unit)} e/s",
         full if section.full_scale == plain.full_scale else "scenario"],
        *optics_rows(spec.camera),
        ["lens", f"f/{number(spec.lens.f_number)}, T {number(spec.lens.transmission)}, "
         f"m {number(spec.lens.magnification)}, PSF {spec.lens.psf}",
         "scenario" if spec.section.lens.f_number else "f-number chosen"],
        ["white on the sensor", f"{number(spec.white)} e/s, "
         f"{number(spec.white * setting.time_constant)} electrons a time constant", "computed"],
        *fault_rows(spec.section),
    ]  # fmt: skip
    return (
        "<h2>The machine</h2>"
        + table(["what", "value", "from"], numbers)
        + "<h2>What was kept and what was left out</h2><p>Nothing was left out.</p>"
        + table(["effect"], [[name] for name in judged.run.result.kept])
    )


def continuous_page(judged: ContinuousRun) -> Page:
    """Writes the figures, and makes the page's parts."""
    spec, reports, counts = judged.spec, judged.views.reports, _counts(judged)
    sections = [
        reports_explorer(judged),
        _images(judged, counts),
        _pixels(judged, counts),
        _traffic(judged),
        _machine(judged),
    ]
    figures = sorted(path.name for path in (judged.run.folder / "figures").glob("*.png"))
    return Page(
        spec.title,
        f"{spec.setting.chip.title}, continuous pixels, {number(spec.setting.clock.hz / 1e3)} "
        f"kHz, {count(reports.ticks)} cycles",
        _simulated(judged),
        _cards(judged),
        sections,
        quality="A higher PSNR is better; fewer reports and bits are cheaper to send.",
        unmeasured="It cannot be measured: these pixels have one tier, with every effect.",
        commands_do="<p>The same bits, however the run is split.</p>",
        files=[f"figures/{name}" for name in figures],
    )
