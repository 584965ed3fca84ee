"""The page of an imager's run: its frames, what they show, what was kept and left out."""

from __future__ import annotations

import time

from cosim.config.amounts import amount
from cosim.report.parts import cards, figure, table
from cosim.report.png import for_display
from cosim.run.machine import Page
from cosim.run.result import Metric
from rtl_model.imagers.interface.kind import ImagerKind
from rtl_model.imagers.report.imager_run import ImagerRun
from rtl_model.imagers.run.store import FRAMES

__all__ = ["imager_page", "metric_text"]


def _cards(run: ImagerRun) -> str:
    result, error = run.run.result, run.run.result.error
    high = "" if error.ci is None else f", at most {error.ci[1]:.2g} (99.9 %)"
    value = "unknown" if error.value is None else f"{error.value:.2g}"
    spent = time.perf_counter() - run.run.began
    out = [row["effect"] for row in result.left_out]
    rows = [
        ("first", value, f"error of a pixel's mean or noise against everything kept{high}; "
         f"{result.tolerance:g} asked for"),
        ("first", f"{spent:.1f} s", f"run time, for {amount(result.simulated_s, 's', 4)} of light"),
        ("first", str(len(out)), f"effects left out{': ' if out else ''}{', '.join(out)}"),
        ("", f"{len(run.frames)}", "frames"),
    ]  # fmt: skip
    return cards(rows)


_SHARES = {
    "saturated": "of the last frame's pixels read the largest value there is",
    "saturated_most": "of the pixels do so in the frame that has most",
    "settled_share": "of the live frames say that the exposure loop rests",
}
_ANSWERS = {"settled": "whether the last live frame says that the exposure loop rests"}
_COUNTS = {
    "frames": "frames", "dark_frames": "frames", "pulses_lost": "pulses of external sync",
    "resets_disturbed": "resets within another row's sampling", "saturated_pixels": "pixels of the "
    "last frame's window over full scale, by the comparator",
}  # fmt: skip


def metric_text(name: str, metric: Metric) -> tuple[str, str]:
    """A metric's value and its unit for a reader: a share in per cent, an answer as yes or no, a
    plain number with what it counts."""
    value, unit = metric.value, "" if metric.unit == "1" else metric.unit
    if value is None:
        return "unknown", unit
    if name in _SHARES:
        return f"{100 * value:.4g} %", _SHARES[name]
    if name in _ANSWERS:
        return "yes" if value else "no", _ANSWERS[name]
    return f"{value:.5g}", _COUNTS.get(name, unit)


def _metrics(run: ImagerRun) -> str:
    rows = [
        [name.replace("_", " "), *metric_text(name, m)]
        for name, m in run.run.result.metrics.items()
    ]
    page = "<h2>Figures of the run</h2>" + table(["what", "value", "unit"], rows)
    delays = [
        [row.stage, *(f"{us / 1e3:.4g} ms" for us in (row.min_us, row.median_us, row.max_us))]
        for row in run.run.result.latency
    ]
    if delays:
        page += "<h2>Delays in the machine</h2>"
        page += table(["from what to what", "least", "median", "most"], delays)
    return page


def _frames(run: ImagerRun) -> str:
    """Chosen frames as they are, full scale white, through the display's curve."""
    full = (1 << run.planned.pixels.bits) - 1
    shown = []
    for n in run.pictures:
        frame = run.frames[n]
        caption = (
            f"frame {frame.number}, read at {frame.ready * 1e-9:.1f} ms, exposed for "
            f"{frame.seconds * 1e3:.4g} ms, mean {frame.mean:.4g} DN"
        )
        shown.append(figure(for_display(run.frame(n) / full), caption))
    return (
        "<h2>Frames</h2><p>Evenly spaced over the run; full scale is white, shown through the sRGB "
        f"curve. All frames, (n, rows, columns) uint16, are <code>zarr.open('{FRAMES}', mode='r')"
        "['values']</code>, linear pictures of these are in <code>images/</code>.</p>"
        f'<div class="grid by4">{"".join(shown)}</div>'
    )


def _kept(run: ImagerRun) -> str:
    plan, summary, patches = run.planned.plan, run.planned.summary, run.chain.patches
    sources = {name: effect.source for name, effect in run.planned.pixels.effects.items()}
    out = set(plan.left_out)
    rows = []
    for row in plan.rows:
        state = "put back" if row.effect in run.reinstated else "kept"
        check = ""
        if row.effect in out:
            state, measured = "left out", patches.measured(row.effect)
            check = "not seen" if measured is None else f"at most {measured.high:.2g}"
        about = "about" if row.kind == "estimate" else "at most"
        cost = f"{row.cost_ns:.3g} ns"
        rows.append(
            [row.effect, state, f"{about} {row.bound:.2g}", cost, check, sources[row.effect]]
        )
    head = ["effect", "", "leaving it out changes", "cost a pixel-frame", "the check", "source"]
    exposures, decisions = run.planned.exposures, run.chain.decisions
    text = ""
    if out and decisions is not None:
        text = (
            f"<p>Decisions: {decisions.text()}. Of each frame it is asked how far what was left "
            "out can move the statistic that the controller goes by; where that reaches a limit of "
            "the decision, the frame is converted with everything and decided on anew.</p>"
        )
    return (
        "<h2>What was kept and what was left out</h2><p>Changes are of a pixel value's mean, "
        "relative to it (at least one DN), or of its noise, relative to that (at least what "
        "rounding makes), whichever is more, over all light and exposures that were foreseen: "
        f"{exposures.seconds[0] * 1e3:.3g} to {exposures.seconds[1] * 1e3:.3g} ms, "
        f"{summary.darkest:.3g} to {summary.brightest:.3g} photoelectrons. An "
        "estimate is given twice its size. The check converts "
        f"{patches.count} patches of the run's own exposures again and again with everything and "
        "without, with the same random numbers, and tells the upper 99.9 % limit. A plan may add "
        f"up to {0.5 * run.run.result.tolerance:g}.</p>" + text + table(head, rows)
    )


def imager_page(kind: ImagerKind, run: ImagerRun) -> Page:
    """Writes the figures; the page that shows them."""
    folder = run.folder / "figures"
    for old in folder.glob("*.png"):
        old.unlink()
    spec, (rows, columns) = run.planned.spec, run.planned.model.shape
    own, frames = "", ""
    if run.frames:
        own, frames = kind.sections(run.planned.model, run), _frames(run)
    return Page(
        title=spec.title,
        subtitle=f"{kind.title}, {columns} x {rows} pixels",
        cards=_cards(run),
        sections=[own, frames, _metrics(run), _kept(run)],
        commands_do="<p>The same bits, however often the run is interrupted.</p>",
        files=sorted(f"figures/{path.name}" for path in folder.glob("*.png")),
    )
