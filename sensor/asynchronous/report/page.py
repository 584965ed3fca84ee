"""The page of a run of an asynchronous camera, with the explorer of its stream: the spikes as
planes of a clock, beside true light.
"""

from __future__ import annotations

import html
from typing import Final

import numpy as np

from cosim.clock import Clock
from cosim.config.amounts import amount, count, decibel, number, percent
from cosim.report.explorer import INSTANTS, Truths, explorer_part, span_of
from cosim.report.figures import overview_figure
from cosim.report.parts import Card, figure, plot, table
from cosim.report.png import for_display
from cosim.run.machine import Page
from cosim.spikes.clocked import ClockedEvents, HeldPlanes, held_events
from cosim.spikes.events import only_full
from cosim.spikes.staged import StagedStream
from sensor.asynchronous.model import latched
from sensor.asynchronous.readout.recorder import STREAM
from sensor.asynchronous.readout.recover import WITHIN
from sensor.asynchronous.readout.shots import rate_image
from sensor.asynchronous.report.figures import (
    delay_figure,
    events_figure,
    target_figure,
    view_figure,
    width_figure,
)
from sensor.asynchronous.run import EventRun
from sensor.sections.provenance import optics_rows

_SPIKES: Final = 16
"""Spikes of white within the window of TFP, about."""
_ENOUGH: Final = 1024
"""Cycles of a short run, at most: with more of them a page has fewer pixels."""


def events_page(judged: EventRun) -> Page:
    """Writes the figures, and makes the page's parts."""
    spec = judged.spec
    pictures = [_view(judged), _targets(judged)] if judged.views.recovered else [_images(judged)]
    sections = [*pictures, events_explorer(judged), _traffic(judged), _machine(judged)]
    figures = sorted(path.name for path in (judged.run.folder / "figures").glob("*.png"))
    return Page(
        spec.title,
        f"{spec.setting.chip.title}, asynchronous pixels",
        _simulated(judged),
        _cards(judged),
        sections,
        quality=_quality(judged),
        commands_do="<p>The same bits, however the run is split.</p>",
        files=[f"figures/{name}" for name in figures],
    )


def _cards(judged: EventRun) -> list[Card]:
    metrics = {name: metric.value for name, metric in judged.run.result.metrics.items()}
    carried = ("", count(metrics["events_carried"]), "events carried")
    if not judged.views.recovered:
        structure = number(metrics["tfi_ssim"])
        text = f"PSNR of TFI against the true light; SSIM {structure}"
        return [("first", decibel(metrics["tfi_psnr"]), text), carried]

    def level(name: str) -> str:
        return amount(metrics[name], "dB", 4)

    def lux(name: str) -> Card:
        error = percent(metrics[f"{name}_error"], sign=True)
        return "", amount(metrics[name], "lux"), f"{name} light recovered, error {error}"

    return [
        ("first", level("dynamic_range"),
         f"dynamic range recovered within {percent(WITHIN)}, by single pixels "
         f"{level('dynamic_range_pixel')}; the paper's formula gives "
         f"{level('dynamic_range_formula')}"),
        lux("brightest"), lux("dimmest"), carried,
    ]  # fmt: skip


def _quality(judged: EventRun) -> str:
    if not judged.views.recovered:
        return "Higher is better."
    return (
        "A wider dynamic range is better: how much brighter the brightest light may be than the "
        "dimmest in one image."
    )


def _simulated(judged: EventRun) -> str:
    """What was simulated, for a newcomer."""
    spec = judged.spec
    height, width = spec.source.shape
    return (
        f"A camera with {width} x {height} pixels, {spec.setting.chip.title}, watches the scene "
        f"“{spec.title}” for {amount(judged.run.result.simulated_s, 's', 4)}. No clock reads it: "
        f"every pixel sends an event as soon as it has collected {number(spec.model.threshold)} "
        "electrons of light, with the time that this took; bright pixels need nanoseconds, dim "
        "ones seconds."
    )


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
    data = view_figure(truth, (rate - spec.mean_dark) / per_lux, rate <= 0, floor, path)
    return (
        "<h2>The view</h2><p>One logarithmic scale for both. Grey pixels sent nothing, or a "
        "reading of less than one level; one whose light is no more than the mean dark current is "
        "black.</p>" + plot(path, "true illuminance, and what each pixel's last event tells", data)
    )


def _targets(judged: EventRun) -> str:
    spec, views = judged.spec, judged.views
    path = judged.run.folder / "figures" / "patches.png"
    data = target_figure(views.recovered, spec.mean_dark / spec.setting.electrons_per_lux, path)
    rows = [
        [
            p.target.name, number(p.lux, 4), number(p.estimate, 4), percent(p.error, sign=True),
            _range(p.low, p.high), number(p.plain, 4), count(p.pixels),
            count(p.fired), count(p.read), count(p.silent), "yes" if p.good else "",
        ]
        for p in views.recovered
    ]  # fmt: skip
    head = ["patch", "true, lux", "recovered, lux", "error", "99.9 %", "plain mean, lux", "pixels",
            "fired", "read", "silent", f"within {percent(WITHIN)}"]  # fmt: skip
    return (
        "<h2>What was recovered</h2><p>Every pixel of a patch is one observation: its first width, "
        "the reading of its charge, or its silence, which says that fewer electrons came than the "
        "threshold. The estimate is the light under which all of them together are most likely, "
        "less the mean dark current; the plain mean of Q/width and of readings rounded down stands "
        "beside "
        "it.</p>"
        + plot(path, "recovered against true illuminance of every patch", data)
        + table(head, rows)
    )


def _images(judged: EventRun) -> str:
    spec, views = judged.spec, judged.views
    ms = 1e3 / spec.setting.clock.hz
    middle = views.shots[len(views.shots) // 2]
    path = judged.run.folder / "figures" / "overview.png"
    panels = [
        (f"true light at {number((middle.cycle + 0.5) * ms, 4)} ms", for_display(middle.truth)),
        ("TFI from events", for_display(middle.tfi)),
    ]
    overview_figure(panels, path)
    parts = [
        "<h2>Images at chosen instants</h2><p>True light, and Q/width of the event that holds the "
        "instant, white of the scene = white, through the sRGB curve. The linear pictures are in "
        "<code>images/</code>.</p>"
    ]
    for shot in views.shots:
        when = f"{number((shot.cycle + 0.5) * ms, 4)} ms"
        pictures = figure(for_display(shot.truth), "true light") + figure(
            for_display(shot.tfi), "TFI from events"
        )
        parts.append(f'<h3>{when}</h3><div class="grid by2">{pictures}</div>')
    return "".join(parts)


def _traffic(judged: EventRun) -> str:
    """Events over time, the sun's widths, and what the channel did with them."""
    spec, views = judged.spec, judged.views
    figures = judged.run.folder / "figures"
    steady = bool(views.recovered)
    data = events_figure(views.sent.instant, spec.stop, steady, figures / "events.png")
    small = ""
    top = views.recovered[0] if views.recovered else None
    if top is not None and top.fired and top.estimate is not None:
        first = latched(views.sent.instant, spec.model.tick) + 1 == views.sent.width
        mine = first & top.target.mask.ravel()[views.sent.pixel]
        rate = top.estimate * spec.setting.electrons_per_lux + spec.mean_dark
        widths = width_figure(
            views.sent.width[mine], rate, spec.model, top.target.name, figures / "widths.png"
        )
        text = "first widths of the brightest patch, and their law"
        small += plot(figures / "widths.png", text, widths)
    section = spec.section.channel
    text = "There is no shared channel: every event leaves as it fires."
    if section is not None and views.delay is not None and views.delay.size:
        service = round(1e12 / section.rate)
        delays = delay_figure(views.delay, service, figures / "channel.png")
        small += plot(figures / "channel.png", "delay of events in the channel", delays)
        place = f"{section.buffer} buffer"
        if section.buffer == "fifo":
            place += f" of {section.depth}"
        text = (
            f"All pixels share one channel of {number(section.rate)} events a second, {place}, "
            f"arbitration {section.arbitration}; t is taken at the {section.timestamp}."
        )
    rows = [
        [name.replace("_", " "), amount(metric.value, metric.unit, 4)]
        for name, metric in judged.run.result.metrics.items()
        if name.startswith(("events", "channel"))
    ]
    rows += [
        [row.stage, ", ".join(
            f"{amount(us * 1e-6, 's', 4)} {name}"
            for name, us in (("min", row.min_us), ("median", row.median_us), ("max", row.max_us))
        )]
        for row in judged.run.result.latency
    ]  # fmt: skip
    return (
        f"<h2>Events</h2><p>{html.escape(text)}</p>"
        + plot(figures / "events.png", "events over time", data)
        + f'<div class="grid by2">{small}</div>'
        + table(["what", "value"], rows)
        + f'<pre>events = numpy.load("{STREAM}")   # row, column, time, width, level, ...</pre>'
    )


def _machine(judged: EventRun) -> str:
    spec = judged.spec
    setting, model, chip = spec.setting, spec.model, spec.setting.chip
    readings = "none"
    if model.longest:
        readings = f"{number(model.longest / 1e12)} s, {model.levels} levels"
    device = setting.pattern
    numbers = [
        ["pixels", f"{chip.width} x {chip.height}", chip.size_origin],
        ["charge threshold Q", f"{number(model.threshold)} e", "scenario"],
        ["shortest width", f"{number(model.shortest / 1e3)} ns", "scenario"],
        ["longest width, reading", readings, "scenario"],
        ["timing clock", f"{number(model.clock.hz / 1e6)} MHz", "scenario"],
        ["comparator delay, reset dead time", f"{model.delay} ps, {model.reset} ps", "scenario"],
        ["sent when a width changes by",
         f"{number(model.change)} RSD" if model.change else "every spike", "scenario"],
        ["dark current, DSNU",
         f"{number(device.dark)} e/s, {percent(device.dsnu)}" if device else "none", "scenario"],
        ["PRNU, threshold FPN",
         f"{percent(device.prnu)}, "
         f"{percent(device.threshold_fpn)}" if device else "none", "scenario"],
        *optics_rows(setting),
        ["lens", f"f/{number(spec.lens.f_number)}, T {number(spec.lens.transmission)}: "
         f"{number(spec.lens.gain)} lux on the pixel for one on the scene", "scenario"],
    ]  # fmt: skip
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers) + _kept(judged)


def _kept(judged: EventRun) -> str:
    """The plan: what acts in how many of the pixels, and what leaving it out elsewhere changes."""
    plan, found = judged.checked.plan, {row["effect"]: row for row in judged.run.result.left_out}
    rows = []
    for planned in plan.rows:
        row = found.get(planned.effect)
        cells = ["", "", ""] if row is None else [
            number(row['bound'], 2), planned.kind, number(row['measured'], 2)
        ]  # fmt: skip
        rows.append([planned.effect, percent(planned.kept), *cells])
    if "shared channel" in judged.run.result.kept:
        rows.append(["shared channel", percent(1), "", "", ""])
    return (
        "<h2>What was kept and what was left out</h2><p>In every tile of 16 x 16 pixels what "
        "changes less than half the tolerance, all together, and costs time is left out. Bound: "
        "the most that it may change of the rate that a pixel reports first, root mean square over "
        "the tile; an estimate stands at twice its size. Measured: on "
        f"{len(judged.checked.tiles)} tiles, with the effect and without it, from the same random "
        "numbers.</p>"
        + table(["effect", "acts in, of all pixels", "bound elsewhere", "kind", "measured"], rows)
    )


def events_explorer(judged: EventRun) -> str:
    """HTML of the section; "" for targets of steady light, whose decades no planes of one clock can
    show."""
    if judged.views.recovered:
        return ""
    spec, events = judged.spec, judged.views.events
    clock, cycles = _clock(judged, spec.setting.clock)
    light = spec.illuminance * spec.lens.gain * spec.setting.electrons_per_lux
    white = float(f"{min(light / spec.model.threshold / clock.hz, 1.0):.4g}")
    told = [f"The page has spikes latched at {amount(clock.hz, 'Hz')}."]
    stage: ClockedEvents | HeldPlanes
    if spec.model.change > 0:
        stage = held_events(events, clock, cycles)
        told.append(
            "The camera sends an event only where a width has changed: until its next event a "
            "pixel fires here at the rate of the last one, once a cycle at most."
        )
    else:
        full, partial = only_full(events)
        stage = ClockedEvents(full, clock, cycles)
        if partial:
            told.append(f"{count(partial)} readings of charge below the threshold are left out.")
    at = cycles // 2
    first, stop = span_of(cycles, at)
    instants = np.unique(np.linspace(first, stop - 1, INSTANTS).round().astype(int)).tolist()
    truths = Truths(instants, [spec.source.truth(clock.middle(k)) for k in instants])
    window = min(2 * int(_SPIKES / max(white, 1e-9) / 2) + 1, 1001)
    stream = StagedStream(stage, spec.shape, cycles, clock)
    part = explorer_part(stream, at, white, window, truths, told=False)
    if isinstance(stage, ClockedEvents) and stage.lost:
        told.append(
            f"{count(stage.lost)} of {count(stage.lost + stage.spikes)} spikes came in a cycle in "
            "which their pixel had fired already: they are missing here, not in the recording."
        )
    return f"<h2>Explore the stream</h2><p>{' '.join(told)}</p>{part}"


def _clock(judged: EventRun, clock: Clock) -> tuple[Clock, int]:
    """The clock of the planes and its cycles: sensor.clock times the largest power of two with
    which the run has at most `_ENOUGH`."""
    cycles = judged.spec.cycles
    while 2 * cycles <= _ENOUGH:
        clock, cycles = Clock(2 * clock.num, clock.den), 2 * cycles
    return clock, cycles


def _range(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return f"below {number(high, 4)}" if high is not None else f"above {number(low, 4)}"
    return f"{number(low, 4)} to {number(high, 4)}"
