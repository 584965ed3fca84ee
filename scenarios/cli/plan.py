"""`viform plan`: what a run would keep and leave out, before it runs."""

from __future__ import annotations

from typing import Any

from scenarios.cli.options import ScenarioName, ScenarioOptions, Tolerance, expand_options
from scenarios.cli.output import Json, make_progress, print_document

__all__ = ["plan"]


@expand_options
def plan(
    scenario: ScenarioName,
    options: ScenarioOptions,
    tolerance: Tolerance = None,
    json: Json = False,
) -> None:
    """Say what a run would keep, what it would leave out, with bounds and predicted cost."""
    from scenarios.assemble.machine import assemble_study

    name, loaded = options.load(scenario, tolerance)
    study = assemble_study("plan", name, loaded, options.device)
    progress = make_progress()
    try:
        document = study.forecast(progress)
    finally:
        progress.close()
    if json:
        print_document(document)
    else:
        print(_text(document))


def _number(value: float | None, unit: str = "") -> str:
    return "unknown" if value is None else f"{value:.3g}{unit}"


def _what(document: dict[str, Any]) -> str:
    if "mode" in document:
        return "the bit error rate's interval (half-widths)"
    if "imager" in document:
        return "a pixel value's mean or noise"
    return "the radiance" if document.get("display") else "the rate"


def _mode(mode: dict[str, Any]) -> str:
    return (
        f"cells of {mode['cell']} x {mode['cell']} panel pixels, {mode['ticks']} ticks a symbol, "
        f"{mode['line']}, {mode['parity']} bytes of parity"
    )


def _spans(planes: int) -> str:
    return "each by itself" if planes == 1 else f"spans of {planes}"


def _promise(document: dict[str, Any]) -> str:
    """What all that is left out and the tier's own arithmetic change together: "at most" only where
    every part of the sum is proven."""
    size = f"{_number(document['promised'])} of {_what(document)}"
    where = "" if "mode" in document or "imager" in document else " in the worst tile"
    if document["promised_kind"] == "proof":
        return f"error promised: at most {size}{where}, a sum of proven bounds"
    return f"error foreseen: {size}{where}, a sum with estimates in it, each at twice its size"


def _imager(document: dict[str, Any]) -> list[str]:
    seen, predicted = document["expected"], document["predicted"]
    (low, high), (dark, bright) = seen["exposure_s"], seen["photoelectrons"]
    return [
        f"about {seen['frames']} frames, exposures of {_number(low)} to {_number(high)} s, "
        f"{_number(dark)} to {_number(bright)} photoelectrons a pixel and frame",
        f"pixels: {_number(predicted['sensor_s'])} s predicted "
        f"({_number(predicted['ns_per_pixel_cycle'])} ns a pixel and frame), with everything kept "
        f"{_number(predicted['everything_s'])} s",
        "a bound with ~ is an estimate, at twice its size; costs are a pixel-frame's",
    ]


def _text(document: dict[str, Any]) -> str:
    """The document for a reader."""
    tiles = document["tiles"]
    counts = ", ".join(f"{count} {kind}" for kind, count in tiles.items() if count)
    lines = [
        f"{document['scenario']}: tolerance {document['tolerance']:g}, {document['tier']} tier on "
        f"{document['device']}",
        *([f"tiles: {counts}"] if counts else []),
        *([f"mode: {_mode(document['mode'])}"] if "mode" in document else []),
        "",
        f"{'effect':<28}{'kept in':>10}{'leaving it out changes':>24}{'costs':>14}",
    ]
    for row in document["rows"]:
        bound = f"{'' if row['kind'] == 'proof' else '~'}{_number(row['bound'])}"
        cost = f"{row['cost_ns']:.3g} ns" if row["cost_ns"] else "nothing"
        lines.append(f"{row['effect']:<28}{row['kept']:>10.1%}{bound:>24}{cost:>14}")
    lines.append("")
    if document["promised"] == 0 and not document.get("left_out"):
        lines.append("nothing is left out")
    elif document["promised"] is not None:
        lines.append(_promise(document))
    if document["promised"] and document["promised"] > document["tolerance"] > 0:
        lines.append(
            "that is more than the tolerance: what is left out is not the cause, but the circuit's "
            "lumped form or this tier's arithmetic; the run measures it"
        )
    if document.get("display"):
        shown = document["display"]
        lines.append(
            f"display: {shown['drive']} drive, seen by {shown['observer']}; only the planes an "
            f"observer can resolve are rendered: {_spans(shown['planes_to_a_span'])}"
        )
    if "imager" in document:
        return "\n".join([*lines, *_imager(document)])
    predicted = document["predicted"]
    if predicted["sensor_s"] is None:
        lines.append(f"full physics would take {_number(predicted['full_physics_s'])} s")
    else:
        lines.append(
            f"sensor: {_number(predicted['sensor_s'])} s predicted "
            f"({_number(predicted['ns_per_pixel_cycle'])} ns a pixel-cycle), with everything kept "
            f"{_number(predicted['everything_s'])} s; full physics would take "
            f"{_number(predicted['full_physics_s'])} s; the scene takes "
            f"{_number(predicted['scene_s'])} s to make"
        )
    lines.append("a bound with ~ is an estimate, at twice its size; costs are a pixel-cycle's")
    return "\n".join(lines)
