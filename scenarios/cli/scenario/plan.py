"""What is known of a run before it: the effects that it would keep and leave out (`viform plan`),
and its error against run time, tier by tier (`viform accuracy`)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.config.amounts import amount, count, elapsed, number, percent
from cosim.plan.error import OTHER_NOISE
from cosim.run.shown import make_progress
from scenarios.cli.options import (
    Draws,
    ScenarioName,
    ScenarioOptions,
    Tolerance,
    check_figure,
    expand_options,
)
from scenarios.cli.output import Json, print_document, tell


@expand_options
def plan(
    scenario: ScenarioName,
    options: ScenarioOptions,
    tolerance: Tolerance = None,
    draws: Draws = None,
    json: Json = False,
) -> None:
    """Print the effects that a run would keep and leave out, with bounds and predicted cost."""
    from scenarios.assemble.machine import assemble_study

    name, loaded = options.load(scenario, tolerance, draws)
    study = assemble_study("plan", name, loaded, options.device)
    progress = make_progress()
    try:
        document = study.forecast(progress)
    finally:
        progress.close()
    if json:
        print_document(document)
    else:
        print(_plan_text(document))


def _quantity(document: dict[str, Any]) -> str:
    """The quantity to which the error is relative."""
    if "mode" in document:
        return "the interval of the bit error rate (half-widths)"
    if "imager" in document:
        return "the mean or noise of a pixel value"
    return "the radiance" if document.get("display") else "the rate"


def _mode(mode: dict[str, Any]) -> str:
    from link.mode import word_code

    return (
        f"cells of {mode['cell']} x {mode['cell']} panel pixels, {mode['ticks']} ticks a symbol, "
        f"{mode['line']}, {word_code(mode['parity'], mode['rate'])}"
    )


def _spans(planes: int) -> str:
    return "single planes" if planes == 1 else f"spans of {planes}"


def _total_bound(document: dict[str, Any]) -> str:
    """The sum of the bounds of all effects left out and of the tier's arithmetic: "at most" only if
    every bound is proven."""
    size = f"{number(document['promised'])} of {_quantity(document)}"
    where = "" if "mode" in document or "imager" in document else " in the worst tile"
    if document["promised_kind"] == "proof":
        return f"error bound: at most {size}{where}, a sum of proven bounds"
    return f"predicted error: {size}{where}, a sum of bounds and doubled estimates"


def _imager(document: dict[str, Any]) -> list[str]:
    expected, predicted = document["expected"], document["predicted"]
    (low, high), (dark, bright) = expected["exposure_s"], expected["photoelectrons"]
    return [
        f"about {count(expected['frames'])} frames, exposures of {amount(low, 's')} to "
        f"{amount(high, 's')}, {number(dark)} to {number(bright)} photoelectrons per pixel and "
        "frame",
        f"pixels: {elapsed(predicted['sensor_s'])} predicted "
        f"({number(predicted['ns_per_pixel_cycle'])} ns per pixel and frame), "
        f"{elapsed(predicted['everything_s'])} with every effect",
        "a bound with ~ is a doubled estimate; costs are per pixel and frame",
    ]


def _run(document: dict[str, Any]) -> list[str]:
    """What the run of a link takes, stage by stage, and what it carries."""
    predicted, amounts, carried = document["predicted"], document["amounts"], document["carried"]
    goodput = carried["goodput_bps"]
    arrives = "no file is predicted to arrive"
    if goodput is not None:
        arrives = f"goodput {amount(goodput, 'bit/s')} predicted"
    return [
        f"{count(amounts['file_bytes'])} bytes in {count(amounts['frames'])} frames and "
        f"{count(amounts['symbols'])} symbols: {count(amounts['cycles'])} cycles; {arrives} "
        f"({amount(carried['raw_bps'], 'bit/s')} raw, {amount(carried['coded_bps'], 'bit/s')} "
        "coded)",
        "",
        f"{'stage':<38}{'works on':>28}{'processor':>12}",
        *(
            f"{row['stage']:<38}{count(row['amount']):>15} {row['unit']:<13}"
            f"{elapsed(row['processor_s']):>11}"
            for row in predicted["stages"]
        ),
        f"the run takes about {elapsed(predicted['total_s'])}, if nothing else uses the machine, "
        f"and {elapsed(predicted['processor_s'])} of its processors",
    ]


def _readout(readout: dict[str, Any]) -> list[str]:
    """What the link behind the chip must carry, and what it loses."""
    size, needed = readout["buffer_bytes"], readout["needed_bps"]
    lines = [
        f"readout: the chip brings {amount(readout['chip_bps'], 'bit/s', 4)} during its scan, "
        f"{amount(readout['mean_bps'], 'bit/s', 4)} on average; with a buffer of {count(size)} "
        f"bytes the link behind must carry {amount(needed, 'bit/s', 6)} to lose nothing"
    ]
    if readout["lost_share"]:
        buffer = readout["needed_buffer_bytes"]
        remedy = (
            "no buffer would be large enough"
            if buffer is None
            else f"none would be lost with a buffer of {count(buffer)} bytes"
        )
        lines.append(
            f"at {amount(readout['rate_bps'], 'bit/s', 6)} it loses "
            f"{percent(readout['lost_share'])} of the rows in the first {count(readout['cycles'])} "
            f"cycles; {remedy}"
        )
    if readout["file_bytes"]:
        lines.append(f"readout.raw takes {number(readout['file_bytes'] / 2**30)} GiB")
    return lines


def _plan_text(document: dict[str, Any]) -> str:
    """The document as text."""
    tiles = document["tiles"]
    counts = ", ".join(f"{count(many)} {kind}" for kind, many in tiles.items() if many)
    lines = [
        f"{document['scenario']}: tolerance {number(document['tolerance'])}, {document['tier']} "
        f"tier on {document['device']}",
        *([f"tiles: {counts}"] if counts else []),
        *([f"mode: {_mode(document['mode'])}"] if "mode" in document else []),
        "",
        f"{'effect':<28}{'kept in':>10}{'leaving it out changes':>24}{'costs':>18}",
    ]
    for row in document["rows"]:
        bound = f"{'' if row['kind'] == 'proof' else '~'}{number(row['bound'])}"
        cost = f"{number(row['cost_ns'])} ns" if row["cost_ns"] else "nothing"
        lines.append(f"{row['effect']:<28}{row['kept']:>10.1%}{bound:>24}{cost:>18}")
    lines.append("")
    if document["promised"] == 0 and not document.get("left_out"):
        lines.append("nothing is left out")
    elif document["promised"] is not None:
        lines.append(_total_bound(document))
    if document["error"]["of"] == "law":
        lines.append(f"it is one in law, with {OTHER_NOISE}")
    elif document["promised"] is not None:
        lines.append("it is one of the run: the noise has the random numbers of full physics")
    if document["promised"] and document["promised"] > document["tolerance"] > 0:
        lines.append(
            "this exceeds the tolerance: the cause is the lumped form of the circuit or the "
            "arithmetic of this tier, not an effect left out; the run measures it"
        )
    for field, how in (("exact_tiles", "in the exact tier"),
                       ("full_physics_tiles", "with full physics")):  # fmt: skip
        if document.get(field):
            lines.append(
                f"{document[field]} of {sum(tiles.values())} tiles are simulated {how}: there the "
                "arithmetic of this tier could use too much of the tolerance"
            )
    for phase in document.get("writes", []):
        lines.append(
            f"from cycle {phase['start']}: threshold {number(phase['threshold'])} e, rows "
            f"{phase['window'][0]} to {phase['window'][1] - 1}"
        )
    if document.get("writes"):
        lines.append("bounds are sums over the thresholds of the run")
    lines += document.get("notes", [])
    if document.get("display"):
        display = document["display"]
        lines.append(
            f"display: {display['drive']} drive, observer {display['observer']}; planes are "
            f"rendered at the resolution of the observer: {_spans(display['planes_to_a_span'])}"
        )
    if "readout" in document:
        lines += _readout(document["readout"])
    if "imager" in document:
        return "\n".join([*lines, *_imager(document)])
    predicted = document["predicted"]
    if predicted["sensor_s"] is None:
        lines.append(f"full physics would take {elapsed(predicted['full_physics_s'])}")
    else:
        beside = {
            "full physics would take": predicted["full_physics_s"],
            "drawing the scene takes": predicted["scene_s"],
        }
        lines.append(
            f"sensor: {elapsed(predicted['sensor_s'])} predicted "
            f"({number(predicted['ns_per_pixel_cycle'])} ns per pixel and cycle), "
            f"{elapsed(predicted['everything_s'])} with every effect"
            + "".join(f"; {what} {elapsed(s)}" for what, s in beside.items() if s is not None)
        )
    if "stages" in predicted:
        lines += _run(document)
    if "memory_bytes" in predicted:
        gib = predicted["memory_bytes"] / 2**30
        lines.append(f"a run needs about {number(gib, 2)} GiB of memory at its peak")
    lines.append("a bound with ~ is a doubled estimate; costs are per pixel and cycle")
    return "\n".join(lines)


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
    print(_accuracy_text(name, document))
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


def _accuracy_text(name: str, document: dict[str, Any]) -> str:
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
