"""The document of `viform design dynamic-range --json`: the ranked choices of a budget."""

from __future__ import annotations

from typing import Any

from sensor.dynamic_range import Budget, Judged, bits_for, measure_chain, sweep

UNITS = {
    "temperature": "degC", "clock": "Hz", "circuit_noise": "V", "analog_gain": "1",
    "digital_gain": "1", "dr_db": "dB", "dr_over_noise_db": "dB", "dr_document_db": "dB",
    "dr_output_db": "dB", "sensor_db": "dB", "saturation": "e", "least_signal": "e", "noise": "e",
    "power": "W",
}  # fmt: skip
"""Units of the figures in a row."""


def _row(one: Judged, used: str) -> dict[str, Any]:
    choice, chain = one.choice, one.chain
    notes = list(one.faults)
    if not chain.dithered:
        notes.append("the converter step exceeds the noise: the range is nominal")
    return {
        "sensor": choice.sensor.name, "adc": choice.converter.name,
        "temperature": choice.celsius, "clock": choice.hertz, "circuit_noise": choice.circuit,
        "analog_gain": choice.analog, "digital_gain": choice.digital,
        "dr_db": chain.derived, "dr_over_noise_db": chain.over_noise,
        "dr_document_db": chain.document, "dr_output_db": one.mapped, "sensor_db": one.rule.sensor,
        "saturation": chain.saturation, "limited_by": chain.limit, "least_signal": chain.least,
        "noise": chain.parts(),
        "adc_rule": {
            "adc_db": one.rule.converter, "ratio_db": one.rule.as_ratio,
            "decibels_db": one.rule.as_decibels, "ratio_holds": one.rule.holds,
            "decibels_holds": one.rule.holds_in_decibels, "used": used,
        },
        "power": one.watts, "price": one.price, "allowed": not one.faults,
        "note": "; ".join(notes),
    }  # fmt: skip


def _ruled_out(
    rows: list[dict[str, Any]], judged: list[Judged], best: dict[str, Any] | None
) -> dict[str, Any] | None:
    """The row `best_without_rule` of `budget_document`."""
    only = [
        row for row, one in zip(rows, judged, strict=True)
        if len(one.faults) == 1 and one.faults[0].startswith("converter rule")
    ]  # fmt: skip
    first = max(only, key=lambda row: row["dr_db"], default=None)
    if first is None or (best is not None and first["dr_db"] <= best["dr_db"]):
        return None
    return first


def budget_document(
    title: str, budget: Budget, *, measure: bool = False, seed: int = 1
) -> dict[str, Any]:
    """Evaluates every choice of a budget.

    Args:
        title: title of the budget.
        budget: choices and limits.
        measure: whether the best choice is simulated; its row then has `measured` {db, ci} with
            limits of 99 % confidence.
        seed: seed of the simulation.

    Returns:
        {title, rows, best, best_without_rule, constraints, swept, parts, units}. `rows` holds every
        choice, the best first. `best` is the first row within all limits, or None.
        `best_without_rule` is the best row that only the converter rule excludes, if it is better
        than `best`, else None: the derived range includes the noise of the converter and needs no
        such rule.
    """
    judged = sweep(budget)
    rows = [_row(one, budget.rule) for one in judged]
    best = dict(rows[0]) if rows and rows[0]["allowed"] else None
    if best is not None:
        sensor = best["sensor_db"]
        best["adc_bits_by_rule"] = None if sensor == float("inf") else {
            "ratio": bits_for(judged[0].rule.as_ratio),
            "decibels": bits_for(judged[0].rule.as_decibels),
        }  # fmt: skip
        if measure:
            measured = measure_chain(judged[0].chain, seed=seed)
            best["measured"] = {"db": measured.db, "ci": [measured.low, measured.high]}
    return {
        "title": title, "rows": rows, "best": best,
        "best_without_rule": _ruled_out(rows, judged, best),
        "constraints": {
            "adc_rule": budget.rule, "power": budget.watts, "price": budget.price,
            "least_signal": budget.least, "exposure_s": budget.seconds,
            "ambient": budget.ambient, "cooler_w_per_k": budget.watts_per_kelvin,
            "gamma": budget.mapping.gamma, "output_bits": budget.mapping.bits,
            "output_holds_db": budget.mapping.holds,
            "allowed": sum(row["allowed"] for row in rows),
        },
        "swept": {
            "sensor": [p.name for p in budget.sensors], "adc": [p.name for p in budget.converters],
            "temperature": list(budget.temperatures), "clock": list(budget.clocks),
            "circuit_noise": list(budget.circuits), "analog_gain": list(budget.analogs),
            "digital_gain": list(budget.digitals),
        },
        "parts": {p.name: p.source for p in budget.sensors}
        | {p.name: p.source for p in budget.converters},
        "units": UNITS,
    }  # fmt: skip
