"""The group `viform design`; `dynamic-range` ranks the choices of a hardware budget by dynamic
range."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.config.amounts import number
from scenarios.cli.options import check_figure
from scenarios.cli.output import Json, print_document, tell

design = typer.Typer(
    name="design",
    help="Choose hardware: dynamic range within a budget.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def design_dynamic_range(
    budget: Annotated[
        str | None, typer.Argument(help="a TOML file of a budget; the built-in one by default")
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="override a key; lists as JSON"),
    ] = None,
    top: Annotated[int, typer.Option(min=1, max=20_000, help="rows of the table")] = 12,
    measure: Annotated[
        bool, typer.Option("--measure", help="also simulate the best choice and measure it")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="seed of --measure")] = 1,
    out: Annotated[Path | None, typer.Option(help="figure to draw, .png or .svg")] = None,
    json: Json = False,
) -> None:
    """Rank every choice of sensor, temperature, circuit, converter and gains by dynamic range.

    Exit 1 if no choice is within the limits of the budget.
    """
    from cosim.files.atomic import atomic_write
    from scenarios.studies.design import budget_document, load_budget, to_budget

    check_figure(out, ".png", ".svg", option="--out")
    file = load_budget(budget, assignments or ())
    document = budget_document(file.title, to_budget(file), measure=measure, seed=seed)
    if out is not None:
        from scenarios.studies.design.figure import draw_budget

        with atomic_write(out) as part:
            draw_budget(document, part, out.suffix[1:].lower())
    if json:
        print_document(document)
    else:
        print(_text(document, top))
        if out is not None:
            tell(f"figure: {out}")
    if document["best"] is None:
        raise typer.Exit(1)


def _watts(row: dict[str, Any]) -> str:
    return "" if row["power"] is None else f"{row['power']:.2f}"


def _text(document: dict[str, Any], top: int) -> str:
    """The document as text."""
    rows, best, limits = document["rows"], document["best"], document["constraints"]
    lines = [f"{document['title']}: {len(rows)} choices, {limits['allowed']} within the limits"]
    if best is None:
        lines.append("no choice is within the limits; the ranking without limits:")
    else:
        rule = best["adc_rule"]
        lines += [
            f"best: {best['sensor']} at {best['temperature']:g} degC and "
            f"{best['clock'] / 1e6:g} MHz, {best['adc']}, circuit "
            f"{best['circuit_noise'] * 1e3:g} mV, analog gain {best['analog_gain']:g}, digital "
            f"gain {best['digital_gain']:g}",
            f"  dynamic range {best['dr_db']:.2f} dB: {number(best['saturation'], 4)} e "
            f"({best['limited_by']}) over {number(best['least_signal'], 4)} e (SNR 1); by the "
            f"formula of the document {best['dr_document_db']:.2f} dB",
            "  noise, e RMS: "
            + ", ".join(f"{name} {number(value)}" for name, value in best["noise"].items()),
            f"  converter {rule['adc_db']:.1f} dB; twice the sensor's "
            f"{best['sensor_db']:.1f} dB is {rule['ratio_db']:.1f} dB as a ratio "
            f"({'holds' if rule['ratio_holds'] else 'does not hold'}), "
            f"{rule['decibels_db']:.1f} dB in decibels "
            f"({'holds' if rule['decibels_holds'] else 'does not hold'}); used: {rule['used']}",
            f"  an output of {limits['output_bits']} bits with gamma {limits['gamma']:g} has "
            f"{best['dr_output_db']:.2f} dB",
        ]
        if "measured" in best:
            low, high = best["measured"]["ci"]
            lines.append(
                f"  measured {best['measured']['db']:.2f} dB, 99 % [{low:.2f}, {high:.2f}]"
            )
    other = document["best_without_rule"]
    if other is not None:
        lines.append(
            f"  the converter rule alone rules out {other['sensor']} at {other['temperature']:g} "
            f"degC with {other['adc']}: {other['dr_db']:.2f} dB (--set adc_rule=none)"
        )
    lines += [
        "",
        f"{'sensor':<18}{'converter':<11}{'degC':>6}{'MHz':>7}{'mV':>7}{'analog':>8}{'digital':>8}"
        f"{'dB':>8}{'document':>9}{'W':>7}  note",
    ]
    for row in rows[:top]:
        lines.append(
            f"{row['sensor'][:17]:<18}{row['adc'][:10]:<11}{row['temperature']:6g}"
            f"{row['clock'] / 1e6:7g}{number(row['circuit_noise'] * 1e3):>7}{row['analog_gain']:8g}"
            f"{row['digital_gain']:8g}{row['dr_db']:8.2f}{row['dr_document_db']:9.2f}"
            f"{_watts(row):>7}  {row['note']}".rstrip()
        )
    if len(rows) > top:
        lines.append(f"... {len(rows) - top} more (--top, --json)")
    return "\n".join(lines)


@design.callback()
def _group() -> None:
    """Without a callback, typer would replace a group of one command by this command."""


design.command("dynamic-range")(design_dynamic_range)
