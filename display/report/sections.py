"""The sections of a report on a display: images and figures of it and of the reference displays.

Without a scene there is neither true light nor a reference display, and without a camera to probe
with no delay and no blur; their sections are then absent.
"""

from __future__ import annotations

import html
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim import Box
from cosim.compute.stopping import threads
from cosim.config.amounts import UNKNOWN, amount, count, decibel, number
from cosim.report.beside import beside
from cosim.report.figures import sheet_figure
from cosim.report.parts import Card, figure, plot, video
from cosim.report.pictures import busiest_box, crop
from cosim.report.png import for_display
from display.chain.clip import RATE, chosen_tiles, write_display_clip
from display.chain.outcome import SPIKE, TRUTH, DisplayOutcome
from display.panels.panel import metric_key
from display.report.figures import latency_figure, wave_figure
from display.report.shown import Shown
from display.report.tables import band_tables, display_table, light_table

Images = npt.NDArray[np.float32]
_SEES = {
    "eye": "What the still eye sees",
    "pursuit": "What the pursuing eye sees",
    "camera": "What a camera sees",
}
_EYES = {"eye": "still eye", "pursuit": "pursuing eye", "camera": "camera"}
_OVERVIEW = 7
"""Maximum number of displays in the overview."""


def _middle(images: Images) -> Images:
    return images[len(images) // 2]


def _worst_box(outcome: DisplayOutcome, observer: str) -> Box:
    """The square in which the displays differ most from the true light; without it, the one with
    the most contrast."""
    if TRUTH not in outcome.images:
        image = _middle(outcome.images[SPIKE][observer])
        return busiest_box(np.abs(image - image.mean()), max(64, min(image.shape) // 4))
    truth = _middle(outcome.images[TRUTH][observer])
    away = np.zeros_like(truth)
    for display in outcome.displays:
        np.maximum(away, np.abs(_middle(outcome.images[display][observer]) - truth), out=away)
    return busiest_box(away, max(64, min(truth.shape) // 4))


def _text(shown: Shown, name: str) -> str:
    """Text of a metric; unknown if there is none."""
    metric = shown.run.result.metrics.get(name)
    if metric is None:
        return UNKNOWN
    if metric.unit == "dB":
        return decibel(metric.value)
    if name.endswith("_us") and metric.value is not None:
        return amount(metric.value * 1e-6, "s")
    return amount(metric.value, metric.unit)


def _latency_card(shown: Shown, drive: str, name: str) -> Card:
    """The latency of the whole chain if a link is part of it, otherwise of camera and display."""
    alone = _text(shown, name)
    through = _text(shown, "latency_photon_us")
    if through != UNKNOWN:
        text = f"photon-to-photon latency through the link; camera and display alone: {alone}"
        return "first", through, text
    bright = _text(shown, "latency_bright_us")
    text = f"photon-to-photon latency, {drive}, mid grey; above full scale, impulse: {bright}"
    return "first", alone, text


def display_cards(shown: Shown) -> list[Card]:
    """Main figures of the display, for `cards`."""
    outcome = shown.outcome
    frames = [name for name in outcome.displays if name.endswith(" Hz")]
    rival = "120 Hz" if "120 Hz" in frames else next(iter(frames), None)

    def beside(name: str) -> str:
        if rival is None:
            return ""
        return f"; a {rival} display: {_text(shown, f'{name}_{metric_key(rival)}')}"

    rows: list[Card] = []
    if outcome.probes is not None:
        drive = outcome.probes.drive
        suffix = "" if drive == "impulse" else f"_{drive}"
        rows += [
            ("first", _text(shown, "ebet_ms_spike"),
             f"blur of the spike display, EBET{beside('ebet_ms')}"),
            _latency_card(shown, drive, f"latency_grey_us{suffix}"),
            ("first", _text(shown, "flicker_svm_spike"),
             "flicker of the spike display, SVM; 1 is just visible"),
        ]  # fmt: skip
    else:
        rows.append(
            (
                "first",
                number(shown.run.result.metrics["total_light"].value),
                "emitted light over that of the spikes",
            )
        )
    if outcome.fidelity:
        rows.append(
            ("first", _text(shown, "psnr_spike"),
             "PSNR of the image in the still eye against that of the true light" + beside("psnr"))
        )  # fmt: skip
    seen = shown.run.result.metrics.get("seen_decades")
    if seen is not None and seen.value is not None:
        scene = number(shown.run.result.metrics["scene_decades"].value)
        rows.append(
            ("first", f"{number(seen.value)} decades", f"of the scene's {scene} that an eye sees")
        )
    return [*rows, *([] if shown.camera is None else shown.camera.cards())]


def display_simulated(shown: Shown) -> str:
    """What a display adds to what is simulated, for a newcomer."""
    beside = ""
    if TRUTH in shown.outcome.images:
        beside = ", beside ordinary displays that show the true light"
    return f"A display shows the spikes as they come, and eyes look at it{beside}."


def display_quality(shown: Shown) -> str:
    """How to read the cards."""
    if not shown.outcome.fidelity:
        return "No image can be rated: the stream has no true light to compare with."
    if shown.outcome.probes is None:
        return "A higher PSNR is better."
    return "Less blur, latency and flicker are better, and a higher PSNR."


def _views(shown: Shown, observer: str) -> str:
    """The middle instant on every display: the square in which they differ most, and the whole."""
    outcome = shown.outcome
    views = {name: _middle(images[observer]) for name, images in outcome.images.items()}
    box = _worst_box(outcome, observer)
    parts = "".join(
        figure(crop(for_display(image), box), outcome.title(name), exact=True)
        for name, image in views.items()
    )
    wholes = "".join(
        figure(for_display(views[name]), outcome.title(name))
        for name in list(views)[:3]
    )  # fmt: skip
    instant = shown.clock.middle(shown.instants[len(shown.instants) // 2]) / 1e9
    most = "which the displays differ most" if TRUTH in views else "which the contrast is largest"
    moving = (
        f" The eye moves at {number(outcome.chain.pursuit.velocity, 4)} pixels/s: objects at that "
        "speed are sharp if the display is fast enough, and static objects are blurred."
        if observer == "pursuit" else ""
    )  # fmt: skip
    return (
        f"<h2>{_SEES[observer]}</h2><p>The images at {number(instant, 4)} ms; white is the white "
        f"of the panel. Rows {box[0]} to {box[1] - 1}, columns {box[2]} to {box[3] - 1}: the "
        f"square in {most}.{moving} Linear images are in <code>images/</code>.</p>"
        f'<div class="grid by4">{parts}</div><div class="grid by3">{wholes}</div>'
    )


def _overview(shown: Shown) -> None:
    """Writes the overview: one row for each eye, one column for each display."""
    outcome = shown.outcome
    truth = [TRUTH] if TRUTH in outcome.images else []
    names = [*truth, *chosen_tiles(outcome.displays, _OVERVIEW - 1)]
    rows = []
    for observer in ("eye", "pursuit"):
        box = _worst_box(outcome, observer)
        images = [crop(for_display(_middle(outcome.images[n][observer])), box) for n in names]
        rows.append(("still eye" if observer == "eye" else "pursuing eye", images))
    path = shown.run.folder / "figures" / shown.overview
    sheet_figure([outcome.title(n) for n in names], rows, path)


def _write_clip(shown: Shown) -> Path:
    outcome, path = shown.outcome, shown.run.folder / "glass.mp4"
    names = chosen_tiles(list(outcome.images))
    motion = outcome.chain.motion
    frames = {name: outcome.frames[name] for name in names}
    write_display_clip(path, frames, {name: outcome.title(name) for name in names}, motion)
    return path


def _clip(outcome: DisplayOutcome, path: Path) -> str:
    motion = outcome.chain.motion
    slower = 1e12 / motion.exposure / RATE
    return (
        f"<h2>Slow motion</h2><p>Camera frames of each display, {count(slower)} times slower than "
        f"real time, {number(motion.exposure / 1e9)} ms exposure a frame (<code>glass.mp4</code>)."
        "</p>" + video(path, "every display in slow motion", 1000)
    )


def _table(outcome: DisplayOutcome) -> str:
    luminance, degree = outcome.chain.panel.luminance, outcome.chain.section.distance
    if outcome.probes is None:
        absent = (
            "Blur, flicker and delay are not measured: their probes need a spike camera of any "
            "size before the panel."
        )
        if not outcome.fidelity:
            return (
                f"<h2>The displays</h2><p>{absent} There is no PSNR and no display beside: a "
                "recorded stream has no true light.</p>"
            )
        return f"<h2>The displays</h2>{display_table(outcome)}<p>{absent}</p>"
    return (
        "<h2>The displays</h2>" + display_table(outcome) +
        "<p>Blur (EBET): an edge from dark to mid grey (0.18 spikes a cycle) moves at 4000 "
        "pixels/s; its rise time from 10 to 90 % on the retina of a pursuing eye, divided by 0.8. "
        "Flicker: of a patch of 16 x 16 pixels of that grey; SVM and visibility (by elaTCSF, at "
        f"{number(luminance)} cd/m² white and {number(degree)} pixels a degree) above 1 are "
        "visible. PSNR: the image in the eye against the image of the true light in the same eye, "
        "white = 1; only for the drive of this run. Delay: median time from a step of the light, "
        "from dark to mid grey, until the display reaches half of it. Frame displays and the "
        "projector receive the true light, without a camera.</p>"
    )  # fmt: skip


def _bands(outcome: DisplayOutcome) -> str:
    probes = outcome.probes
    seen = (
        "<h3>What the still eye sees, by luminance</h3><p>Pixels are grouped by the true "
        "luminance in the still eye (white = 1); mean over the instants: PSNR (peak 1) and SSIM, "
        "then mean and RMS of the error relative to that luminance.</p>"
        + "<br>".join(band_tables(outcome))
    )
    if probes is None:
        return f"<h2>By luminance</h2>{seen}"
    pst = ""
    if probes.pst_lm is not None:
        pst = (
            f" PstLM of a patch of mid grey, over one minute: {number(probes.pst_lm, 2)} "
            "(the EU limit for lamps is 1)."
        )
    return (
        "<h2>By luminance and drive</h2><p>Dim pixels fire rarely: with the impulse drive they "
        "flicker; with the hold drive they wait for a second spike. The table has steady patches "
        "of 16 x 16 pixels, the median of single pixels, and edges at each light; <i>never</i>: "
        "the light does not reach half of the step within the observed time. The figures of frame "
        "displays do not depend on the light; the table above has them."
        + pst
        + "</p>"
        + light_table(outcome)
        + seen
    )


def _waves(shown: Shown) -> str:
    path = shown.run.folder / "figures" / "waves.png"
    caption, data = wave_figure(shown, path)
    return (
        f"<h2>Light of single pixels</h2><p>{html.escape(caption)}</p>"
        + plot(path, "light of single pixels on every display, over time", data)
    )  # fmt: skip


def _delays(shown: Shown) -> str:
    path = shown.run.folder / "figures" / "latency.png"
    data = latency_figure(shown.outcome, path)
    return (
        "<h2>From photon to photon</h2><p>The time from a step of the light until the light of the "
        "display crosses half of the step, over all phases of the clock and all rows: mean of each "
        "part (bars), median and 5 to 95 % of the total (lines); a median outside the frame is "
        "written as a number. Interval: until the pixel fires, or, for a frame display, until the "
        "next frame. Readout: until the row is driven. Hold: until the light crosses half; a panel "
        "that holds intervals waits for a second spike.</p>"
        + plot(path, "time from light to light by stage, for five levels of light", data)
    )


def _beside(shown: Shown) -> str:
    """The explorer: any display beside any other, for each observer."""
    outcome = shown.outcome
    names = list(outcome.images)
    views = {}
    for observer in outcome.chain.observers:
        box = _worst_box(outcome, observer)
        shots = [[for_display(image) for image in outcome.images[n][observer]] for n in names]
        views[f"{_EYES[observer]}, whole"] = shots
        views[f"{_EYES[observer]}, a square in full"] = [
            [crop(image, box) for image in images] for images in shots
        ]
    instants = [f"{shown.clock.middle(n) / 1e9:.2f} ms" for n in shown.instants]
    part = beside([outcome.title(name) for name in names], "eye", views, instants)
    if len(names) == 1:
        return (
            "<h2>The display at any instant</h2><p>What an observer sees at the instants of the "
            f"images. The whole is reduced; the square has all of its pixels.</p>{part}"
        )
    return (
        "<h2>Any display beside any other</h2><p>What an observer sees at the instants of the "
        "images. The whole is reduced; the square is the one in which the displays differ most, "
        f"with all of its pixels.</p>{part}"
    )


def display_sections(shown: Shown) -> tuple[list[str], list[str]]:
    """The sections of a display, HTML, and the names of the files that they are made of: figures
    and glass.mp4."""
    outcome, body, files = shown.outcome, [], [f"figures/{shown.overview}"]
    with threads(1) as pool:  # the clip is encoded while figures are drawn
        coding = pool.submit(_write_clip, shown)
        _overview(shown)
        if shown.camera is not None:
            body.append(shown.camera.section(shown))
            files += shown.camera.figures
        body += [_views(shown, observer) for observer in outcome.chain.observers]
        if outcome.fidelity:
            body += [_bands(outcome), _waves(shown)]
            files.append("figures/waves.png")
        if outcome.probes is not None:
            body.append(_delays(shown))
            files.append("figures/latency.png")
        body = [_table(outcome), _beside(shown), _clip(outcome, coding.result()), *body]
    return body, [*files, "glass.mp4"]
