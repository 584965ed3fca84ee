"""The page of a run of one of the other imagers: its frames, what they show, what it cost."""

from __future__ import annotations

import html
import shlex
import time

from cosim.config.amounts import amount
from cosim.config.toml import to_toml
from cosim.report.parts import cards, figure, opening, run_time, table, write_page
from cosim.report.png import for_display
from cosim.run.result import Metric
from rtl_model.imagers.run.store import FRAMES
from rtl_model.imagers.sections import AdaptiveSection, EbapsSection
from scenarios.assemble.run_imager import ImagerRun

__all__ = ["said", "write_imager_report"]

_TITLES = {
    "adaptive-exposure": "adaptive-exposure CMOS sensor",
    "ebaps": "EBAPS imaging circuit",
    "emccd": "frame-transfer EMCCD",
}


def _cards(run: ImagerRun) -> str:
    result, error = run.result, run.result.error
    high = "" if error.ci is None else f", at most {error.ci[1]:.2g} (99.9 %)"
    told = "unknown" if error.value is None else f"{error.value:.2g}"
    spent = time.perf_counter() - run.began
    out = [row["effect"] for row in result.left_out]
    rows = [
        ("first", told, f"error of a pixel's mean or noise against everything kept{high}; "
         f"{result.tolerance:g} asked for"),
        ("first", f"{spent:.1f} s", f"run time, for {amount(result.simulated_s, 's', 4)} of light"),
        ("first", str(len(out)), f"effects left out{': ' if out else ''}{', '.join(out)}"),
        ("", f"{len(run.filmed.taken)}", "frames"),
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


def said(name: str, metric: Metric) -> tuple[str, str]:
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
    rows = [[name.replace("_", " "), *said(name, m)] for name, m in run.result.metrics.items()]
    page = "<h2>Figures of the run</h2>" + table(["what", "value", "unit"], rows)
    delays = [
        [row.stage, *(f"{us / 1e3:.4g} ms" for us in (row.min_us, row.median_us, row.max_us))]
        for row in run.result.latency
    ]
    if delays:
        page += "<h2>Delays in the machine</h2>"
        page += table(["from what to what", "least", "median", "most"], delays)
    return page


def _frames(run: ImagerRun) -> str:
    """Chosen frames as they are, full scale white, through the display's curve."""
    full = (1 << run.run.pixels.bits) - 1
    shown = []
    for n in run.pictures:
        frame = run.filmed.taken[n]
        told = (
            f"frame {frame.number}, read at {frame.ready * 1e-9:.1f} ms, exposed for "
            f"{frame.seconds * 1e3:.4g} ms, mean {frame.mean:.4g} DN"
        )
        shown.append(figure(for_display(run.frame(n) / full), told))
    return (
        "<h2>Frames</h2><p>Evenly spaced over the run; full scale is white, shown through the sRGB "
        f"curve. All frames are in <code>{FRAMES}</code>, linear pictures of these in "
        f'<code>images/</code>.</p><div class="grid by4">{"".join(shown)}</div>'
    )


def _kept(run: ImagerRun) -> str:
    plan, patches = run.run.plan, run.filmed.patches
    sources = {name: effect.source for name, effect in run.run.pixels.effects.items()}
    out = set(plan.left_out)
    rows = []
    for row in plan.rows:
        told = "put back" if row.effect in run.filmed.put_back else "kept"
        check = ""
        if row.effect in out:
            told, measured = "left out", patches.measured(row.effect)
            check = "not seen" if measured is None else f"at most {measured.high:.2g}"
        about = "about" if row.kind == "estimate" else "at most"
        cost = f"{row.cost_ns:.3g} ns"
        rows.append(
            [row.effect, told, f"{about} {row.bound:.2g}", cost, check, sources[row.effect]]
        )
    head = ["effect", "", "leaving it out changes", "cost a pixel-frame", "the check", "source"]
    seen, decided = run.run.expected, run.filmed.decided
    decisions = ""
    if out and decided is not None:
        decisions = (
            f"<p>Decisions: {decided.told()}. Of each frame it is asked how far what was left out "
            "can move the statistic that the controller goes by; where that reaches a limit of the "
            "decision, the frame is converted with everything and decided on anew.</p>"
        )
    return (
        "<h2>What was kept and what was left out</h2><p>Changes are of a pixel value's mean, "
        "relative to it (at least one DN), or of its noise, relative to that (at least what "
        "rounding makes), whichever is more, over all light and exposures that were foreseen: "
        f"{seen.seconds[0] * 1e3:.3g} to {seen.seconds[1] * 1e3:.3g} ms, "
        f"{run.run.summary.darkest:.3g} to {run.run.summary.brightest:.3g} photoelectrons. An "
        "estimate is given twice its size. The check converts "
        f"{patches.seen} patches of the run's own exposures again and again with everything and "
        "without, with the same random numbers, and tells the upper 99.9 % limit. A plan may add "
        f"up to {0.5 * run.result.tolerance:g}.</p>" + decisions + table(head, rows)
    )


def _again(run: ImagerRun) -> str:
    lines = [
        f"viform run {shlex.quote(str(run.folder / 'scenario.toml'))}",
        f'frames = zarr.open("{FRAMES}", mode="r")["values"]   # (n, rows, columns) uint16',
    ]
    return (
        "<h2>Make it again</h2><p>The same bits, however often the run is interrupted.</p>"
        f"<pre>{html.escape(chr(10).join(lines))}</pre>"
        f"<h2>The resolved scenario</h2><pre>{html.escape(to_toml(run.run.scenario))}</pre>"
    )


def _of_its_kind(run: ImagerRun) -> str:
    """What the imager's own document shows of it."""
    section = run.run.scenario.imager
    if isinstance(section, AdaptiveSection):
        from rtl_model.imagers.adaptive.pages import adaptive_sections

        return adaptive_sections(run)
    if isinstance(section, EbapsSection):
        from rtl_model.imagers.ebaps.pages import ebaps_sections

        return ebaps_sections(run)
    from rtl_model.imagers.emccd.pages import emccd_sections

    return emccd_sections(run)


def write_imager_report(run: ImagerRun) -> list[str]:
    """Writes figures and report.html into the run's folder; their names."""
    begin = time.perf_counter()
    (run.folder / "figures").mkdir(exist_ok=True)
    for old in (run.folder / "figures").glob("*.png"):
        old.unlink()
    own = _of_its_kind(run) if run.filmed.taken else ""
    frames = _frames(run) if run.filmed.taken else ""
    seconds = run.filmed.seconds | {"report": time.perf_counter() - begin}
    kind = _TITLES.get(run.run.scenario.imager.kind, run.run.scenario.imager.kind)
    rows, columns = run.run.machine.shape
    title = run.run.scenario.title
    body = [
        opening(title, f"{kind}, {columns} x {rows} pixels", run.result, run.notes),
        _cards(run), own, frames, _metrics(run), _kept(run), run_time(run.result, seconds),
        _again(run),
    ]  # fmt: skip
    write_page(run.folder, title, "".join(body))
    figures = sorted(path.name for path in (run.folder / "figures").glob("*.png"))
    return [*(f"figures/{name}" for name in figures), "report.html"]
