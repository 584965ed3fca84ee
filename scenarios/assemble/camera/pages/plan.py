"""What a run's plan kept and left out, what the check found, and where on the plane."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Final

import numpy as np

from cosim.report.figures import INK, LINE, MARK, pyplot
from cosim.report.parts import plot, table
from scenarios.assemble.camera.judged import LatchedRun

__all__ = ["error_card", "full_physics_card", "left_out_card", "plan_section"]

_COLOURS: Final = (
    "#d0d9e8", "#74a7dd", "#2f6db5", "#b7ddb0", "#5fa55a", "#f2d38b", "#c9a2d8", "#8a8f9c",
)  # fmt: skip
"""Of the commonest sets of effects; the rest share the last."""


def error_card(run: LatchedRun) -> tuple[str, str]:
    """The error with its upper limit and how it is known."""
    error = run.result.error
    if error.value is None:
        return "unknown", "error against full physics"
    high = "" if error.ci is None else f", at most {error.ci[1]:.2g} (99.9 %)"
    return (
        f"{error.value:.2g}",
        f"error against full physics{high}, {error.kind}; {run.scenario.tolerance:g} asked for",
    )


def full_physics_card(run: LatchedRun) -> tuple[str, str]:
    """What the reference would have taken for the camera."""
    metric = run.result.metrics.get("full_physics")
    seconds = None if metric is None else metric.value
    if seconds is None or not np.isfinite(seconds):
        return "unknown", "time that full physics would have taken"
    spent = run.seconds.get("sensor")
    beside = "" if not spent else f"; the camera took {spent:.3g} s"
    return f"{seconds:.3g} s", f"full physics for every pixel, predicted from the patches{beside}"


def left_out_card(run: LatchedRun) -> tuple[str, str]:
    """How many effects some tile does without."""
    names = run.plan.plan.left_out
    return str(len(names)), f"effects left out: {', '.join(names)}" if names else "effects left out"


def _rows(run: LatchedRun) -> list[list[str]]:
    shown = run.plan.full_display
    effects = [*run.setting.acting_effects, *(shown.acting_effects if shown is not None else ())]
    sources = {effect.name: effect.source for effect in effects}
    measured = {row["effect"]: row["measured"] for row in run.result.left_out}
    back = {finding.effect for finding in run.put_back}
    rows = []
    for row in run.plan.plan.rows:
        share = f"{row.kept:.1%}" if row.kept not in (0.0, 1.0) else f"{row.kept:.0%}"
        found = measured.get(row.effect)
        if found is not None:
            said = f"at most {found:.2g}"
        elif row.effect in back:
            said = "put back"
        else:
            said = "" if row.kept == 1 else "no patch leaves it out"
        rows.append([
            row.effect, share, f"{row.bound:.2g}", row.kind,
            f"{row.cost_ns:.2g} ns" if row.cost_ns else "nothing", said,
            sources.get(row.effect, ""),
        ])  # fmt: skip
    return rows


def _summary(run: LatchedRun) -> str:
    """Tolerance, tier, what was promised, what the tiles are."""
    plan, survey = run.plan.plan, run.plan.survey
    promised = float(plan.total.max()) + run.plan.own
    classes = ", ".join(f"{count} {kind}" for kind, count in survey.classes.items() if count)
    if plan.tolerance == 0:
        opening = f"Tolerance 0 keeps every effect; {run.plan.tier} tier."
    else:
        opening = (
            f"Asked for: an error of at most {plan.tolerance:g}; {run.plan.tier} tier. What bounds "
            f"promise of all that was left out, together: {promised:.2g} in the worst tile, where "
            f"{plan.tolerance / 2:g} is allowed."
        )
    return (
        f"{opening} The plane is {len(survey.grid)} tiles of 16 x 16 pixels: {classes}. "
        f"{len(run.plan.patches(run.scenario.seed))} of them were checked: filmed by the "
        "reference with everything, by the camera as planned, and without one effect at a time, "
        "all with the same random numbers."
    )


def _put_back(run: LatchedRun) -> str:
    if not run.put_back:
        return ""
    rows = [
        [
            f.effect, "all, against the tolerance" if f.tile is None else f"tile {f.tile}",
            f"{f.promised:.2g}", f"{f.measured:.2g}",
        ]
        for f in run.put_back
    ]  # fmt: skip
    return (
        "<h3>Put back</h3><p>The check found these, so the run was done again with the effect kept "
        "everywhere, or in the exact tier.</p>"
        + table(["effect", "where", "promised at most", "changed up to"], rows)
    )


def _map(run: LatchedRun, path: Path) -> list[list[str]]:
    """figures/plan.png: what each tile leaves out and which were checked; the legend's rows."""
    plan, grid = run.plan.plan, run.plan.survey.grid
    names = list(plan.kept)
    kept = np.stack([np.broadcast_to(plan.kept[n], len(grid)) for n in names])
    sets, which, counts = np.unique(kept, axis=1, return_inverse=True, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    place = np.empty(len(order), int)
    place[order] = np.minimum(np.arange(len(order)), len(_COLOURS) - 1)
    plt = pyplot()
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch, Rectangle

    rows, columns = grid.shape
    figure, axes = plt.subplots(figsize=(8.6, max(5.2 * min(rows / columns, 1.2), 2.2)))
    axes.imshow(
        place[which.ravel()].reshape(grid.shape), cmap=ListedColormap(_COLOURS), vmin=-0.5,
        vmax=len(_COLOURS) - 0.5, interpolation="nearest",
    )  # fmt: skip
    side = max(1.0, max(rows, columns) / 60)
    for tile in run.plan.patches(run.scenario.seed):
        row, column = divmod(tile, columns)
        corner = (column - side / 2, row - side / 2)
        axes.add_patch(Rectangle(corner, side, side, fill=False, edgecolor=MARK, linewidth=1.6))
    legend, handles = [], []
    for n, index in enumerate(order):
        out = [name for name, k in zip(names, sets[:, index], strict=True) if not k]
        gone = ", ".join(out) or "nothing"
        legend.append([str(n + 1), f"{counts[index]}", gone])
        if n < len(_COLOURS):
            short = f"without {gone}" if len(gone) <= 40 else f"without {len(out)}, see the table"
            handles.append(
                Patch(color=_COLOURS[n], label=f"{n + 1}: {short if out else 'with everything'}")
            )
    handles.append(Patch(fill=False, edgecolor=MARK, label="checked"))
    axes.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=8, frameon=False
    )
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_color(LINE)
    axes.set_title("tiles of the plane, by what they leave out", fontsize=10, color=INK)
    figure.savefig(path, dpi=110, bbox_inches="tight", pad_inches=0.08)
    plt.close(figure)
    return legend


def plan_section(run: LatchedRun) -> str:
    """The section; writes figures/plan.png, but where a board made the spikes."""
    if run.scenario.sensor.source is not None:
        return (
            "<h2>What was kept and what was left out</h2><p>Nothing was planned: a board made the "
            "spikes. Its electrons in a tick are whole numbers up to 255, and it has no shot noise "
            "and none of the faults of simulated pixels.</p>"
        )
    path = run.folder / "figures" / "plan.png"
    legend = _map(run, path)
    head = [
        "effect", "kept in", "leaving it out changes", "", "cost a pixel-cycle", "the check",
        "source",
    ]  # fmt: skip
    return (
        f"<h2>What was kept and what was left out</h2><p>{html.escape(_summary(run))}</p>"
        + table(head, _rows(run))
        + "<p>Changes are relative to a tile's spike rate over the image window, RMS over its "
        "pixels, at most over the tiles that leave the effect out, or over all where none does; an "
        "estimate is given twice its size. The check tells the upper 99.9 % limit on the patches "
        "that leave it out.</p>"
        + _put_back(run)
        + plot(path, "what each tile keeps")
        + table(["set", "tiles", "without"], legend)
    )
