"""The section of a report on the plan: effects kept and left out, tile by tile, and their check."""

from __future__ import annotations

import html
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim.config.amounts import amount, count, number, percent
from cosim.report.drawn import Data, Value, write_figure
from cosim.report.explorer import explorer, packed
from cosim.report.figures import LINE, MARK, subplots
from cosim.report.parts import plot, table
from cosim.run.result import Metric
from scenarios.assemble.source.latched.judged import LatchedRun
from sensor.latched.effects.own_draws import OWN_DRAWS, SOURCE

_COLOURS: Final = (
    "#d0d9e8", "#74a7dd", "#2f6db5", "#b7ddb0", "#5fa55a", "#f2d38b", "#c9a2d8", "#8a8f9c",
)  # fmt: skip
"""Colours of the most frequent sets of effects; all others have the last colour."""


def _rows(run: LatchedRun) -> list[list[str]]:
    display = run.plan.full_display
    effects = [*run.setting.acting_effects, *(() if display is None else display.acting_effects)]
    sources = {OWN_DRAWS: SOURCE} | {effect.name: effect.source for effect in effects}
    measured = {row["effect"]: row["measured"] for row in run.result.left_out}
    reinstated = {finding.effect for finding in run.reinstated}
    bank, rows = run.bank, []
    for row in run.plan.plan.rows:
        limit = measured.get(row.effect)
        if row.effect == OWN_DRAWS and bank is not None:
            check = (
                f"rate {number(bank.rate, 1, sign=True)} ± {number(bank.rate_width, 1)}, "
                f"noise {number(bank.noise, 1, sign=True)} ± {number(bank.noise_width, 1)}"
            )
        elif limit is not None:
            check = f"at most {number(limit, 2)}"
        elif row.effect in reinstated:
            check = "reinstated"
        else:
            check = "" if row.kept == 1 else "no patch leaves it out"
        rows.append([
            row.effect, percent(row.kept), number(row.bound, 2), row.kind,
            amount(row.cost_ns, "ns", 2) if row.cost_ns else "nothing", check,
            sources.get(row.effect, ""),
        ])  # fmt: skip
    return rows


def _summary(run: LatchedRun) -> str:
    """Tolerance, tier, sum of the bounds, kinds of tiles, and checked tiles."""
    plan, survey = run.plan.plan, run.plan.survey
    promised = float(run.plan.promised.max())
    classes = ", ".join(f"{count(n)} {kind}" for kind, n in survey.classes.items() if n)
    counts = ((int(run.plan.exact.sum()), "in the exact tier"),
              (run.plan.full_physics, "with full physics"))  # fmt: skip
    better = "".join(
        f" {count(n)} tiles are simulated {how}, because the arithmetic of this tier could use too "
        "much of the tolerance there." for n, how in counts if n
    )  # fmt: skip
    if plan.tolerance == 0:
        opening = f"Tolerance 0 keeps every effect; {run.plan.tier} tier."
    else:
        opening = (
            f"The tolerance is {number(plan.tolerance)}; {run.plan.tier} tier. The bounds of all "
            f"effects that are left out add up to {number(promised, 2)} in the worst tile; "
            f"{number(plan.tolerance / 2)} "
            "is allowed."
        )
    return (
        f"{opening}{better} The plane consists of {count(len(survey.grid))} tiles of 16 x 16 "
        f"pixels: {classes}. {len(run.plan.patches(run.scenario.seed))} of them were checked as a "
        "whole: they were simulated with the reference (every effect), with the planned camera, "
        "and without one effect at a time, all with the same random numbers. In others a few "
        "pixels were checked. The upper limit of the error holds for all tiles: for those that "
        "were not checked as a whole it is the bound of the plan."
    )


def _bank_text(run: LatchedRun) -> str:
    """How thresholds from the bank were checked, for a run that has any."""
    if run.bank is None:
        return ""
    return (
        " Thresholds from the bank belong to cycles, and cannot be paired with those of the "
        "reference. So the error of this run is one in law. On the patches one camera has the "
        "draws of the reference, for what else is left out, and a second one films as this run "
        "does, with the bank. The table says by how much rate and noise of the second differ, "
        "relative to the rate, on the average of all patches, and how far off that may be by "
        "chance. The bound is computed from the distributions themselves."
    )


def _reinstated(run: LatchedRun) -> str:
    if not run.reinstated:
        return ""
    rows = [
        [
            f.effect, "all patches, with the tolerance" if f.tile is None else f"tile {f.tile}",
            number(f.promised, 2), number(f.measured, 2),
        ]
        for f in run.reinstated
    ]  # fmt: skip
    return (
        "<h3>Reinstated effects</h3><p>The check exceeded the bounds of these effects. The run was "
        "repeated with the effect in all tiles, or in the exact tier.</p>"
        + table(["effect", "where", "bound", "measured, upper limit"], rows)
    )


def _map(run: LatchedRun, path: Path) -> tuple[list[list[str]], Data]:
    """Writes figures/plan.png, a map of the effects that each tile leaves out and of the checked
    tiles; returns the rows of its legend, and the set of each tile."""
    plan, grid = run.plan.plan, run.plan.survey.grid
    names = list(plan.kept)
    kept = np.stack(
        [np.broadcast_to(plan.kept[n], len(grid)) for n in names] + [run.plan.fine, run.plan.exact]
    )
    sets, which, counts = np.unique(kept, axis=1, return_inverse=True, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    place = np.empty(len(order), int)
    place[order] = np.minimum(np.arange(len(order)), len(_COLOURS) - 1)
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch, Rectangle

    rows, columns = grid.shape
    figure, axes = subplots(figsize=(8.6, max(5.2 * min(rows / columns, 1.2), 2.2)))
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
        *has, fine, exact = sets[:, index]
        better = "exact tier" if exact else "full physics"
        out = [name for name, k in zip(names, has, strict=True) if not k]
        absent = ", ".join(out) or "nothing"
        legend.append([str(n + 1), count(counts[index]), f"nothing, {better}" if fine else absent])
        if n < len(_COLOURS):
            short = f"without {absent}" if len(absent) <= 40 else f"without {len(out)}, see table"
            label = better if fine else short if out else "every effect"
            handles.append(Patch(color=_COLOURS[n], label=f"{n + 1}: {label}"))
    handles.append(Patch(fill=False, edgecolor=MARK, label="checked"))
    axes.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=8, frameon=False
    )
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_color(LINE)
    write_figure(figure, path, bbox_inches="tight", pad_inches=0.08)
    sets_of = place[which.ravel()] + 1
    places_of: list[tuple[Value, ...]] = [
        (float(tile // columns), float(tile % columns), float(set_of))
        for tile, set_of in enumerate(sets_of)
    ]
    return legend, Data(("row of tiles", "column of tiles", "set"), places_of)


def _explorer(run: LatchedRun) -> str:
    """The map of tiles to explore."""
    plan, grid = run.plan.plan, run.plan.survey.grid
    rows, columns = grid.shape

    def whole(values: Any, kind: Any) -> str:
        return packed(np.broadcast_to(values, len(grid)).astype(kind))

    effects = [
        {"name": name, "kept": whole(plan.kept[name], np.uint8),
         "bound": whole(plan.promise[name], np.float32)}
        for name in plan.kept
    ]  # fmt: skip
    absent = [n for n, name in enumerate(plan.kept) if not np.all(plan.kept[name])]
    tier = np.where(run.plan.fine, np.where(run.plan.exact, 1, 2), 0)
    given = {
        "rows": rows, "columns": columns, "effects": effects, "first": (absent or [0])[0],
        "tier": whole(tier, np.uint8), "checked": run.plan.patches(run.scenario.seed),
        "tiers": [f"{run.plan.tier} tier", "exact tier", "full physics"],
    }  # fmt: skip
    return explorer(given, "tiles")


def board_error(metrics: Mapping[str, Metric]) -> str:
    """How wrong the spikes of a board may be: they are not simulated, but compared."""
    wrong = count(metrics["board_bits_wrong"].value)
    return (
        "There is nothing to estimate: a board made the spikes, and they are compared with the "
        f"cycle model bit by bit. Bits that differ: {wrong}."
    )


def plan_section(run: LatchedRun) -> str:
    """HTML of the section; writes figures/plan.png unless a board generated the spikes."""
    if run.scenario.sensor.source is not None:
        return (
            "<h2>What was kept and what was left out</h2><p>There is no plan: a board generated "
            "the spikes. Its pixels receive an integer number of electrons, at most 255, in each "
            "tick, without shot noise and without the other effects of simulated pixels.</p>"
        )
    path = run.folder / "figures" / "plan.png"
    legend, sets = _map(run, path)
    head = [
        "effect", "kept in", "leaving it out changes", "known by", "cost a pixel-cycle",
        "the check",
        "source",
    ]  # fmt: skip
    return (
        f"<h2>What was kept and what was left out</h2><p>{html.escape(_summary(run))}</p>"
        + table(head, _rows(run))
        + "<p>Changes are relative to the spike rate of a tile over the image window, RMS over its "
        "pixels: the maximum over the tiles that leave the effect out, or over all tiles if none "
        "does. Estimates are doubled. The check is the upper 99.9 % limit, measured on the patches "
        f"that leave the effect out.{_bank_text(run)}</p>"
        + _reinstated(run)
        + plot(path, "tiles by the effects left out; squares: checked as a whole", sets)
        + table(["set", "tiles", "left out"], legend)
        + f"<h3>Point at a tile</h3>{_explorer(run)}"
    )
