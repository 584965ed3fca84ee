"""`viform link ber`: error-rate curves, theory with Monte Carlo beside it.

The functions import what they need: the start of other commands must not wait for it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.config.amounts import number
from cosim.run.shown import make_progress
from scenarios.cli.output import Json, print_document, tell


def link_ber(
    points: Annotated[int, typer.Option(min=2, max=64, help="points of each curve")] = 8,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="seed of all Monte Carlo")] = 1,
    out: Annotated[
        Path | None, typer.Option(help="a folder for ber.png, ber.svg and ber.json; made new")
    ] = None,
    detectors: Annotated[
        bool, typer.Option(help="also compare detectors on the sensor's pixels, a minute")
    ] = True,
    json: Json = False,
) -> None:
    """Draw error rates against theory; exit 1 when a point of 100 errors or more disagrees."""
    from cosim import InputError
    from link.evaluation.curves import error_curves, measure_curves
    from link.evaluation.detectors import compare_detectors

    if out is not None and (out.exists() or not out.absolute().parent.is_dir()):
        raise InputError(
            "--out", "a new folder in one that exists", str(out), "choose another name"
        )
    progress = make_progress()
    try:
        curves = error_curves(points)
        progress.start("curves", len(curves))
        begun: list[str] = []

        def report(title: str) -> None:
            progress.advance(len(begun))
            begun.append(title)

        document = measure_curves(curves, seed, report)
        progress.advance(len(curves))
        document["detectors"] = compare_detectors(seed) if detectors else []
    finally:
        progress.close()
    if out is not None:
        _write(document, out)
    if json:
        print_document(document)
    else:
        print(_text(document))
        if out is not None:
            tell(f"figure: {out / 'ber.png'}, {out / 'ber.svg'}")
    if not document["holds"]:
        raise typer.Exit(1)


def _write(document: dict[str, Any], out: Path) -> None:
    """The folder, whole or not at all."""
    from cosim.files.whole import whole
    from cosim.run.result import dumps
    from link.report.curves import draw_curves

    with whole(out) as part:
        part.mkdir()
        for kind in ("png", "svg"):
            draw_curves(document, part / f"ber.{kind}")
        (part / "ber.json").write_text(dumps(document) + "\n", encoding="utf-8")


def _text(document: dict[str, Any]) -> str:
    """The document for a reader."""
    lines = []
    for curve in document["curves"]:
        lines.append(f"{curve['title']}   ({curve['name']})")
        beside = curve.get("beside")
        head = f"  {curve['x_unit']:>16} {'theory':>14} {'measured':>14}  {'interval':<30}"
        head += f"{'errors':>7} {curve['trial'] + 's':>10}  theory"
        lines.append(head + (f"   {beside['name']}" if beside else ""))
        for i, x in enumerate(curve["x"]):
            span = f"[{number(curve['low'][i])}, {number(curve['high'][i])}]"
            mark = "inside" if curve["inside"][i] else "OUTSIDE"
            theory, measured = (number(curve[key][i], 4) for key in ("theory", "measured"))
            row = f"  {number(x, 4):>16} {theory:>14} {measured:>14}  {span:<30}"
            row += f"{curve['errors'][i]:7} {curve['bits'][i]:10}  "
            row += mark if curve["judged"][i] else f"({mark})"
            if beside:
                refuted = "outside" if beside["refuted"][i] else "inside"
                row += f"   {number(beside['theory'][i])}, {refuted}"
            lines.append(row)
        lines.append("")
    holds = "all of them inside" if document["holds"] else "NOT all of them inside"
    lines.append(
        f"{document['points_judged']} points of 100 errors or more, {holds}: Clopper-Pearson at "
        f"{number(document['pointwise_level'], 6)} each, which holds for all together at "
        f"{number(document['level'], 2)} (Bonferroni)"
    )
    return "\n".join([*lines, *_detectors(document["detectors"])])


def _detectors(rows: list[dict[str, Any]]) -> list[str]:
    """A table of detectors side by side."""
    if not rows:
        return []
    limits = "99.9 % interval"
    head = f"  {'':<40}{'theory':>12} {'measured':>12}  {limits:<26}{'errors':>7} {'bits':>8}  gain"
    lines = ["", "Detectors on exact pixels: residual reset, Q = 100 e, ON 1.5 Q, OFF 0.1 Q", head]
    for row in rows:
        theory = "" if row["theory"] is None else number(row["theory"])
        gain = "" if row["gain_low"] is None else f"at least {number(row['gain_low'])} times"
        span = f"[{number(row['low'])}, {number(row['high'])}]"
        lines.append(
            f"  {row['what']:<40}{theory:>12} {number(row['rate']):>12}  {span:<26}"
            f"{row['errors']:7} {row['bits']:8}  {gain}"
        )
    return lines
