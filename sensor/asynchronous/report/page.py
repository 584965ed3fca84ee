"""The page of a run of an asynchronous camera."""

from __future__ import annotations

import html
import time

import numpy as np

from cosim.config.amounts import amount
from cosim.report.figures import overview_figure
from cosim.report.parts import cards, figure, plot, table
from cosim.report.png import for_display
from cosim.run.machine import Page
from sensor.asynchronous.model import latched
from sensor.asynchronous.plan.verify import KIND
from sensor.asynchronous.readout.image import rate_image
from sensor.asynchronous.readout.recorder import STREAM
from sensor.asynchronous.readout.recover import WITHIN
from sensor.asynchronous.report.figures import (
    delay_figure,
    events_figure,
    target_figure,
    view_figure,
    width_figure,
)
from sensor.asynchronous.run import EventRun
from sensor.sections.provenance import optics_rows

__all__ = ["events_page"]


def _number(value: float | None, digits: str = ".3g") -> str:
    return "unknown" if value is None else format(value, digits)


def _range(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return f"below {high:.4g}" if high is not None else f"above {_number(low, '.4g')}"
    return f"{low:.4g} to {high:.4g}"


def _lux(value: float | None) -> str:
    return "unknown" if value is None else amount(value, "lux")


def _cards(judged: EventRun) -> str:
    metrics = {name: metric.value for name, metric in judged.run.result.metrics.items()}
    spent = time.perf_counter() - judged.run.began
    rows: list[tuple[str, str, str]] = [
        (
            "first",
            f"{spent:.1f} s",
            f"run time, for {amount(judged.run.result.simulated_s, 's', 4)} of light",
        ),
        ("first", f"{metrics['events_carried']:,.0f}", "events carried"),
        (
            "first",
            f"{judged.checked.error.value:.2g}",
            "error against full physics: " + KIND + f", 99.9 % {judged.checked.error.low:.2g} to "
            f"{judged.checked.error.high:.2g}; tolerance {judged.run.result.tolerance:g}",
        ),
    ]
    if judged.views.recovered:
        rows += [
            ("", f"{_number(metrics['dynamic_range'], '.1f')} dB",
             f"recovered within {WITHIN:.0%}, by single pixels "
             f"{_number(metrics['dynamic_range_pixel'], '.1f')} dB; the paper's formula gives "
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


def _view(judged: EventRun) -> str:
    """Illuminance of every pixel from its last event."""
    spec, views = judged.spec, judged.views
    per_lux = spec.setting.electrons_per_lux
    model, events = spec.model, views.events
    rate = rate_image(events, events.ticks, model.threshold, model.delay / 1e12)
    truth = spec.source.truth(spec.stop - 1).astype(np.float64)
    truth *= spec.illuminance * spec.lens.gain
    path = judged.run.folder / "figures" / "view.png"
    floor = min(p.lux for p in views.recovered) / 2
    view_figure(truth, (rate - spec.mean_dark) / per_lux, rate <= 0, floor, path)
    return (
        "<h2>The view</h2><p>One logarithmic scale for both. Grey pixels sent nothing, or a "
        "reading of less than one level; one whose light is no more than the mean dark current is "
        "black.</p>" + plot(path, "the view")
    )


def _targets(judged: EventRun) -> str:
    spec, views = judged.spec, judged.views
    path = judged.run.folder / "figures" / "patches.png"
    target_figure(views.recovered, spec.mean_dark / spec.setting.electrons_per_lux, path)
    rows = [
        [
            p.target.name, f"{p.lux:.4g}", _number(p.estimate, ".4g"), _number(p.error, "+.2%"),
            _range(p.low, p.high), _number(p.plain, ".4g"), str(p.pixels),
            str(p.fired), str(p.read), str(p.silent), "yes" if p.good else "",
        ]
        for p in views.recovered
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


def _images(judged: EventRun) -> str:
    spec, views = judged.spec, judged.views
    ms = 1e3 / spec.setting.clock.hz
    middle = views.shots[len(views.shots) // 2]
    path = judged.run.folder / "figures" / "overview.png"
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
    for shot in views.shots:
        when = f"{(shot.cycle + 0.5) * ms:.3f} ms"
        pictures = figure(for_display(shot.truth), "true light") + figure(
            for_display(shot.tfi), "TFI from events"
        )
        parts.append(f'<div class="row-title">{when}</div><div class="grid by2">{pictures}</div>')
    return "".join(parts)


def _traffic(judged: EventRun) -> str:
    """Events over time, the sun's widths, and what the channel did with them."""
    spec, views = judged.spec, judged.views
    figures = judged.run.folder / "figures"
    steady = bool(views.recovered)
    events_figure(views.sent.instant, spec.stop, steady, figures / "events.png")
    small = ""
    top = views.recovered[0] if views.recovered else None
    if top is not None and top.fired and top.estimate is not None:
        first = latched(views.sent.instant, spec.model.tick) + 1 == views.sent.width
        mine = first & top.target.mask.ravel()[views.sent.pixel]
        rate = top.estimate * spec.setting.electrons_per_lux + spec.mean_dark
        width_figure(
            views.sent.width[mine], rate, spec.model, top.target.name, figures / "widths.png"
        )
        small += plot(figures / "widths.png", "widths of the brightest patch")
    section = spec.section.channel
    text = "There is no shared channel: every event leaves as it fires."
    if section is not None and views.delay is not None and views.delay.size:
        service = round(1e12 / section.rate)
        delay_figure(views.delay, service, figures / "channel.png")
        small += plot(figures / "channel.png", "delay in the channel")
        place = f"{section.buffer} buffer"
        if section.buffer == "fifo":
            place += f" of {section.depth}"
        text = (
            f"All pixels share one channel of {section.rate:g} events a second, {place}, "
            f"arbitration {section.arbitration}; t is taken at the {section.timestamp}."
        )
    rows = [
        [name.replace("_", " "), f"{metric.value:,.6g}" if metric.value is not None else "unknown"]
        for name, metric in judged.run.result.metrics.items()
        if name.startswith(("events", "channel"))
    ]
    rows += [
        [f"{row.stage}, µs", f"{row.min_us:.4g} min, {row.median_us:.4g} median, "
         f"{row.max_us:.4g} max"]
        for row in judged.run.result.latency
    ]  # fmt: skip
    return (
        f"<h2>Events</h2><p>{html.escape(text)}</p>"
        + plot(figures / "events.png", "events over time")
        + f'<div class="grid by2" style="margin:10px 0">{small}</div>'
        + table(["what", "value"], rows)
        + f'<pre>events = numpy.load("{STREAM}")   # row, column, time, width, level, ...</pre>'
    )


def _machine(judged: EventRun) -> str:
    spec = judged.spec
    setting, model, chip = spec.setting, spec.model, spec.setting.chip
    readings = f"{model.longest / 1e12:g} s, {model.levels} levels" if model.longest else "none"
    device = setting.pattern
    numbers = [
        ["pixels", f"{chip.width} x {chip.height}", chip.size_origin],
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
        ["lens", f"f/{spec.lens.f_number:.3g}, T {spec.lens.transmission:g}: "
         f"{spec.lens.gain:.3g} lux on the pixel for one on the scene", "scenario"],
    ]  # fmt: skip
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers) + _kept(judged)


def _kept(judged: EventRun) -> str:
    """The plan: what acts in how many of the pixels, and what leaving it out elsewhere changes."""
    plan, found = judged.checked.plan, {row["effect"]: row for row in judged.run.result.left_out}
    rows = []
    for effect, share in zip(plan.effects, plan.shares(), strict=True):
        row = found.get(effect.name)
        cells = ["", "", ""] if row is None else [
            f"{row['bound']:.2g}", effect.kind, f"{row['measured']:.2g}"
        ]  # fmt: skip
        rows.append([effect.name, f"{share:.0%}", *cells])
    if "shared channel" in judged.run.result.kept:
        rows.append(["shared channel", "100%", "", "", ""])
    return (
        "<h2>What was kept and what was left out</h2><p>In every tile of 16 x 16 pixels what "
        "changes less than half the tolerance, all together, and costs time is left out. Bound: "
        "the most that it may change of the rate that a pixel reports first, root mean square over "
        "the tile. Measured: on "
        f"{len(judged.checked.tiles)} tiles, with the effect and without it, from the same random "
        "numbers.</p>"
        + table(["effect", "acts in, of all pixels", "bound elsewhere", "kind", "measured"], rows)
    )


def events_page(judged: EventRun) -> Page:
    """Writes the figures, and makes the page's parts."""
    spec = judged.spec
    pictures = [_view(judged), _targets(judged)] if judged.views.recovered else [_images(judged)]
    sections = [*pictures, _traffic(judged), _machine(judged)]
    figures = sorted(path.name for path in (judged.run.folder / "figures").glob("*.png"))
    return Page(
        spec.title,
        f"{spec.setting.chip.title}, asynchronous readout",
        _cards(judged),
        sections,
        commands_do="<p>The same bits, however the run is split.</p>",
        files=[f"figures/{name}" for name in figures],
    )
