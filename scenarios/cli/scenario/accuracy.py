"""`viform accuracy`: error against run time, for each tier."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.config.amounts import count, number
from cosim.run.shown import make_progress
from scenarios.cli.options import ScenarioName, ScenarioOptions, check_figure, expand_options
from scenarios.cli.output import Json, print_document, tell


@expand_options
def accuracy(
    scenario: ScenarioName,
    options: ScenarioOptions,
    figure: Annotated[Path | None, typer.Option(help="PNG to draw, error against run time")] = None,
    every_tile: Annotated[
        bool,
        typer.Option("--every-tile", help="Measure all tiles, not a few"),
    ] = False,
    json: Json = False,
) -> None:
    """Measure error against run time, for every tier at a ladder of tolerances."""
    from cosim import InputError
    from scenarios.assemble.machine import assemble_study

    name, loaded = options.load(scenario)
    study = assemble_study("accuracy", name, loaded, options.device)
    check_figure(figure)
    measure = getattr(study, "every_tile", None) if every_tile else study.ladder
    if measure is None:
        raise InputError(
            "--every-tile", "given with a scenario of a latched chip", name, "leave it out",
        )  # fmt: skip
    if every_tile and figure is not None:
        raise InputError("--figure", "given without --every-tile", "with it", "leave one out")
    progress = make_progress()
    try:
        document = measure(progress)
    finally:
        progress.close()
    if every_tile:
        if json:
            print_document(document)
        else:
            print(_tiles_text(name, document))
        if not all(row["holds"] for row in document["rows"]):
            raise typer.Exit(1)
        return
    if figure is not None:
        from cosim.report.accuracy import accuracy_figure

        accuracy_figure(name, document, figure)
    if json:
        print_document(document)
        return
    print(_text(name, document))
    if figure is not None:
        tell(f"figure: {figure}")


def _number(value: float | None) -> str:
    return "" if value is None else number(value)


def _error(row: dict[str, Any]) -> str:
    if row["error"] is None:
        return "unknown"
    low, high = row["ci"] or (None, None)
    span = "" if high is None else f" [{_number(low)}, {_number(high)}]"
    return f"{number(row['error'])}{span}"


def _tiles_text(name: str, document: dict[str, Any]) -> str:
    """The document of `--every-tile` as text."""
    rows = document["rows"]
    lines = [
        f"{name}: error of the {document['error_of']} against full physics, in {rows[0]['tiles']} "
        "tiles",
        "",
        f"{'tolerance':>9}  {'tier':<6}{'stated error':<32}{'outcome':<10}{'worst tile':>18}"
        f"{'above limit':>13}{'above tolerance':>17}{'full physics':>14}",
    ]
    for row in rows:
        over = row["over_tolerance"]
        lines.append(
            f"{_number(row['tolerance']):>9}  {row['tier']:<6}{_error(row):<32}"
            f"{row['outcome']:<10}{number(row['worst_error']):>10} ({row['worst_tile']:>5})"
            f"{row['over_limit']:>13}{'' if over is None else over:>17}"
            f"{row['full_physics_tiles']:>14}"
        )
    return "\n".join(lines)


def _text(name: str, document: dict[str, Any]) -> str:
    """The document as text."""
    reference = document["reference"]
    best = reference["ns_per_pixel_cycle"]
    cycle = "pixel-frame" if "frames" in reference else "pixel-cycle"
    full: list[str] = next((r["effects"] for r in document["rows"] if r["tier"] == "reference"), [])
    where = "the worst tile"
    if "bits" in reference:
        where = (
            f"of the {document['error_of']}, on {count(reference['bits'])} bits of "
            f"{reference['patches']} patches (rate {number(reference['bit_error_rate'])}, "
            f"half-width in the run {number(reference['half_width'])})"
        )
    if "frames" in reference:
        where = (
            f"of the mean or noise of a pixel value, in the worst of {reference['patches']} "
            f"patches of {reference['frames']} frames"
        )
    lines = [
        f"{name}: error against full physics, {where}, with its 99.9 % interval",
        "",
        f"{'tier':<10}{'tolerance':>10}  {'error':<30}{'time':>10}{f'ns a {cycle}':>18}"
        f"{'speed-up':>14}  left out",
    ]
    for row in document["rows"]:
        if row.get("failed"):
            lines.append(
                f"{row['tier']:<10}{_number(row['tolerance']):>10}  failed: {row['failed']}"
            )
            continue
        out = [e for e in full if e not in row["effects"]]
        part = [e for e in row.get("left_out", []) if e not in out]
        left = ", ".join(out + [f"{e} in part" for e in part]) or "nothing"
        ns = row["ns_per_pixel_cycle"]
        lines.append(
            f"{row['tier']:<10}{_number(row['tolerance']):>10}  {_error(row):<30}"
            f"{_number(row['run_time_s']):>8} s{_number(ns):>18}"
            f"{_number(best / ns) if ns and best else '':>14}  {left}"
        )
    floor = document["floor"]
    order = document["order"]
    lines += [
        "",
        f"order: error ~ tolerance^{order:.2f}, fitted" if order is not None
        else "order: unknown, too few rows depend on the tolerance",
        f"error of the reference: {_number(floor['reference'])}",
    ]  # fmt: skip
    if reference.get("decisions") == "not compared":
        lines.append(
            "errors are at equal exposures; the influence of effects left out on the decisions of "
            "the exposure controller is not compared here: `viform run` checks it"
        )
    if "bits" in reference:
        lines.append(
            f"standard error of the rate of these bits: {_number(floor['monte_carlo'])}; the rows "
            "share the random numbers of the reference"
        )
    elif floor["monte_carlo"] is not None:
        lines.append(
            f"statistical error of the mean of one tile in one window: "
            f"{_number(floor['monte_carlo'])}; the rows share the random numbers of the reference, "
            "so smaller errors are resolved"
        )
    return "\n".join(lines)
