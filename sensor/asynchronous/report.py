"""The page of a run with event readout."""

from __future__ import annotations

import html
import shlex
import time

import numpy as np

from cosim.config.amounts import amount
from cosim.config.toml import to_toml
from cosim.report.figures import overview_figure
from cosim.report.parts import cards, figure, opening, plot, run_time, table, write_page
from cosim.report.png import for_display
from scenarios.assemble.run_events import EventRun
from sensor.asynchronous import latched
from sensor.asynchronous.figures import (
    delay_figure,
    events_figure,
    patch_figure,
    view_figure,
    width_figure,
)
from sensor.asynchronous.image import rate_image
from sensor.asynchronous.output import STREAM
from sensor.asynchronous.recover import WITHIN
from sensor.asynchronous.verify import KIND
from sensor.sections.provenance import optics_rows

__all__ = ["write_events_report"]


def _number(value: float | None, digits: str = ".3g") -> str:
    return "unknown" if value is None else format(value, digits)


def _range(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return f"below {high:.4g}" if high is not None else f"above {_number(low, '.4g')}"
    return f"{low:.4g} to {high:.4g}"


def _lux(value: float | None) -> str:
    return "unknown" if value is None else amount(value, "lux")


def _cards(run: EventRun) -> str:
    metrics = {name: metric.value for name, metric in run.result.metrics.items()}
    spent = time.perf_counter() - run.began
    rows: list[tuple[str, str, str]] = [
        (
            "first",
            f"{spent:.1f} s",
            f"run time, for {amount(run.result.simulated_s, 's', 4)} of light",
        ),
        ("first", f"{metrics['events_carried']:,.0f}", "events carried"),
        (
            "first",
            f"{run.checked.error.value:.2g}",
            "error against full physics: " + KIND + f", 99.9 % {run.checked.error.low:.2g} to "
            f"{run.checked.error.high:.2g}; tolerance {run.result.tolerance:g}",
        ),
    ]
    if run.found:
        rows += [
            ("", f"{_number(metrics['dynamic_range'], '.1f')} dB",
             f"recovered within {WITHIN:.0%}; the paper's formula gives "
             f"{_number(metrics['dynamic_range_formula'], '.1f')} dB"),
            ("", _lux(metrics["brightest"]),
             f"brightest, error {_number(metrics['brightest_error'], '+.2%')}"),
            ("", _lux(metrics["dimmest"]),
             f"dimmest, error {_number(metrics['dimmest_error'], '+.2%')}"),
        ]  # fmt: skip
    else:
        rows.append(("", f"{_number(metrics['tfi_psnr'], '.1f')} dB",
                     f"TFI against the truth, SSIM {_number(metrics['tfi_ssim'])}"))  # fmt: skip
    return cards(rows)


def _view(run: EventRun) -> str:
    """Illuminance of every pixel, as its last event tells it."""
    per_lux = run.setting.electrons_per_lux
    rate = rate_image(run.events, run.events.ticks, run.model.threshold, run.model.delay / 1e12)
    dark = run.setting.pattern.dark if run.setting.pattern is not None else 0.0
    truth = run.source.truth(run.stop - 1).astype(np.float64)
    truth *= run.scenario.scene.illuminance * run.lens.gain
    path = run.folder / "figures" / "view.png"
    view_figure(truth, (rate - dark) / per_lux, rate <= 0, min(p.lux for p in run.found) / 2, path)
    return (
        "<h2>The view</h2><p>One logarithmic scale for both. Grey pixels sent nothing, or a "
        "reading of less than one level; one whose light is no more than the mean dark current is "
        "black.</p>" + plot(path, "the view")
    )


def _patches(run: EventRun) -> str:
    path = run.folder / "figures" / "patches.png"
    dark = run.setting.pattern.dark if run.setting.pattern is not None else 0.0
    patch_figure(run.found, dark / run.setting.electrons_per_lux, path)
    rows = [
        [
            p.target.name, f"{p.lux:.4g}", _number(p.estimate, ".4g"), _number(p.error, "+.2%"),
            _range(p.low, p.high), _number(p.plain, ".4g"), str(p.pixels),
            str(p.fired), str(p.read), str(p.silent), "yes" if p.good else "",
        ]
        for p in run.found
    ]  # fmt: skip
    head = ["patch", "true, lux", "recovered, lux", "error", "99.9 %", "plain mean, lux", "pixels",
            "fired", "read", "silent", f"within {WITHIN:.0%}"]  # fmt: skip
    return (
        "<h2>What was recovered</h2><p>Every pixel of a patch is one observation: its first width, "
        "the reading of its charge, or its silence, which says that fewer electrons came than the "
        "threshold. The estimate is the light under which all of them together are most likely, "
        "less the mean dark current; the plain mean of Q/width and of readings rounded down stands "
        "beside it.</p>" + plot(path, "recovered against true") + table(head, rows)
    )


def _images(run: EventRun) -> str:
    ms = 1e3 / run.setting.clock.hz
    middle = run.shots[len(run.shots) // 2]
    path = run.folder / "figures" / "overview.png"
    panels = [
        (f"true light at {(middle.cycle + 0.5) * ms:.2f} ms", for_display(middle.truth)),
        ("TFI from events", for_display(middle.tfi)),
    ]
    overview_figure(panels, path)
    parts = [
        "<h2>Images at chosen instants</h2><p>True light, and Q/width of the event that holds the "
        "instant, white of the scene = white, through the sRGB curve. The linear pictures are in "
        "<code>images/</code>.</p>"
    ]
    for shot in run.shots:
        when = f"{(shot.cycle + 0.5) * ms:.3f} ms"
        pictures = figure(for_display(shot.truth), "true light") + figure(
            for_display(shot.tfi), "TFI from events"
        )
        parts.append(f'<div class="row-title">{when}</div><div class="grid by2">{pictures}</div>')
    return "".join(parts)


def _traffic(run: EventRun) -> str:
    """Events over time, the sun's widths, and what the channel did with them."""
    figures = run.folder / "figures"
    steady = bool(run.found)
    events_figure(run.sent.instant, run.stop, steady, figures / "events.png")
    small = ""
    if run.found and run.found[0].fired and run.found[0].estimate is not None:
        top = run.found[0]
        first = latched(run.sent.instant, run.model.tick) + 1 == run.sent.width
        mine = first & top.target.mask.ravel()[run.sent.pixel]
        dark = run.setting.pattern.dark if run.setting.pattern is not None else 0.0
        assert top.estimate is not None
        rate = top.estimate * run.setting.electrons_per_lux + dark
        width_figure(run.sent.width[mine], rate, run.model, top.target.name, figures / "widths.png")
        small += plot(figures / "widths.png", "widths of the brightest patch")
    section = run.scenario.sensor.channel
    said = "There is no shared channel: every event leaves as it fires."
    if section is not None and run.delay is not None and run.delay.size:
        service = round(1e12 / section.rate)
        delay_figure(run.delay, service, figures / "channel.png")
        small += plot(figures / "channel.png", "delay in the channel")
        place = f"{section.buffer} buffer"
        if section.buffer == "fifo":
            place += f" of {section.depth}"
        said = (
            f"All pixels share one channel of {section.rate:g} events a second, {place}, "
            f"arbitration {section.arbitration}; t is taken at the {section.timestamp}."
        )
    rows = [
        [name.replace("_", " "), f"{metric.value:,.6g}" if metric.value is not None else "unknown"]
        for name, metric in run.result.metrics.items()
        if name.startswith(("events", "channel"))
    ]
    rows += [
        [f"{row.stage}, µs", f"{row.min_us:.4g} min, {row.median_us:.4g} median, "
         f"{row.max_us:.4g} max"]
        for row in run.result.latency
    ]  # fmt: skip
    return (
        f"<h2>Events</h2><p>{html.escape(said)}</p>"
        + plot(figures / "events.png", "events over time")
        + f'<div class="grid by2" style="margin:10px 0">{small}</div>'
        + table(["what", "value"], rows)
    )


def _machine(run: EventRun) -> str:
    setting, model, chip = run.setting, run.model, run.setting.chip
    provenance = chip.provenance()
    readings = f"{model.longest / 1e12:g} s, {model.levels} levels" if model.longest else "none"
    device = setting.pattern
    numbers = [
        ["pixels", f"{chip.width} x {chip.height}", provenance["width"]],
        ["charge threshold Q", f"{model.threshold} e", "scenario"],
        ["shortest width", f"{model.shortest / 1e3:g} ns", "scenario"],
        ["longest width, reading", readings, "scenario"],
        ["timing clock", f"{model.clock.hz / 1e6:g} MHz", "scenario"],
        ["comparator delay, reset dead time", f"{model.delay} ps, {model.reset} ps", "scenario"],
        ["sent when a width changes by", f"{model.change:g} RSD" if model.change else "every spike",
         "scenario"],
        ["dark current, DSNU", f"{device.dark:g} e/s, {device.dsnu:.0%}" if device else "none",
         "scenario"],
        ["PRNU, threshold FPN",
         f"{device.prnu:.1%}, {device.threshold_fpn:.1%}" if device else "none", "scenario"],
        *optics_rows(setting),
        ["lens", f"f/{run.lens.f_number:.3g}, T {run.lens.transmission:g}: {run.lens.gain:.3g} lux "
         "on the pixel for one on the scene", "scenario"],
    ]  # fmt: skip
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers) + _kept(run)


def _kept(run: EventRun) -> str:
    """The plan: what acts in how many of the pixels, and what leaving it out elsewhere changes."""
    plan, found = run.checked.plan, {row["effect"]: row for row in run.result.left_out}
    rows = []
    for effect, out in zip(plan.effects, plan.left_out, strict=True):
        share = 1 - float(plan.scene.pixels[out].sum() / plan.scene.pixels.sum())
        row = found.get(effect.name)
        told = ["", "", ""] if row is None else [
            f"{row['bound']:.2g}", effect.kind, f"{row['measured']:.2g}"
        ]  # fmt: skip
        rows.append([effect.name, f"{share:.0%}", *told])
    rows += [[name, "100%", "", "", ""] for name in run.result.kept if name == "shared channel"]
    return (
        "<h2>What was kept and what was left out</h2><p>In every tile of 16 x 16 pixels what "
        "changes less than half the tolerance, all together, and costs time is left out. Bound: "
        "the most that it may change of the rate that a pixel reports first, root mean square over "
        "the tile. Measured: on "
        f"{len(run.checked.tiles)} tiles, with the effect and without it, from the same random "
        "numbers.</p>"
        + table(["effect", "acts in, of all pixels", "bound elsewhere", "kind", "measured"], rows)
    )


def _again(run: EventRun) -> str:
    line = f"viform run {shlex.quote(str(run.folder / 'scenario.toml'))}"
    arrays = f'events = numpy.load("{STREAM}")   # row, column, time, width, level, ...'
    return (
        run_time(run.result, run.seconds)
        + "<h2>Make it again</h2><p>The same bits, however the run is split.</p>"
        + f"<pre>{html.escape(line + chr(10) + arrays)}</pre>"
        + f"<h2>The resolved scenario</h2><pre>{html.escape(to_toml(run.scenario))}</pre>"
    )


def write_events_report(run: EventRun) -> list[str]:
    """Writes figures and report.html into the run's folder; their names."""
    begin = time.perf_counter()
    (run.folder / "figures").mkdir(exist_ok=True)
    shown = [_view(run), _patches(run)] if run.found else [_images(run)]
    shown += [_traffic(run), _machine(run)]
    run.seconds["report"] = time.perf_counter() - begin
    body = [
        opening(
            run.scenario.title,
            f"{run.setting.chip.title}, asynchronous readout",
            run.result,
            run.notes,
        ),
        _cards(run),
        *shown,
        _again(run),
    ]
    write_page(run.folder, run.scenario.title, "".join(body))
    figures = sorted(path.name for path in (run.folder / "figures").glob("*.png"))
    return [*(f"figures/{name}" for name in figures), "report.html"]
