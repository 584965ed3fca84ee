"""What theory says of a link: error-rate curves, with Monte Carlo beside them (`viform link ber`),
and what its light and pixels could carry, beside what its design does (`capacity`).

The functions import what they need: the start of other commands must not wait for it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.config.amounts import amount, number
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
        _write_curves(document, out)
    if json:
        print_document(document)
    else:
        print(_curves_text(document))
        if out is not None:
            tell(f"figure: {out / 'ber.png'}, {out / 'ber.svg'}")
    if not document["holds"]:
        raise typer.Exit(1)


def _write_curves(document: dict[str, Any], out: Path) -> None:
    """The folder, whole or not at all."""
    from cosim.files.atomic import atomic_write
    from cosim.run.result import dumps
    from link.report.curves import draw_curves

    with atomic_write(out) as part:
        part.mkdir()
        for kind in ("png", "svg"):
            draw_curves(document, part / f"ber.{kind}")
        (part / "ber.json").write_text(dumps(document) + "\n", encoding="utf-8")


def _curves_text(document: dict[str, Any]) -> str:
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


def link_capacity(
    scenario: Annotated[
        str, typer.Argument(help="a link's scenario: a name, a TOML file, or the folder of a run")
    ] = "light-link",
    assignments: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="override a key")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="seed of the scenario, and of Monte Carlo")
    ] = None,
    symbols: Annotated[
        int, typer.Option(min=8, max=4096, help="symbols of random data in each pilot")
    ] = 24,
    points: Annotated[int, typer.Option(min=2, max=32, help="points of each curve")] = 5,
    out: Annotated[
        Path | None,
        typer.Option(
            help="a folder for capacity.png, capacity.svg and capacity.json, with curves over "
            "distance, light and cell (some minutes); made new"
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Tell how far a link's design is from capacity, and what costs what.

    The bound and the budget are closed forms. The achievable information is simulated: pilots on a
    strip of the panel, half a minute. Parts of the mode that a run would choose from a pilot are
    2 x 2 cells, 1 tick, scrambled and 32 parity bytes; name others with --set link.modem.cell=1 and
    the like.
    """
    from cosim import InputError
    from link.evaluation.capacity_curves import CURVES, CapacityStudy
    from link.prediction.capacity import capacity_document, scenario_input
    from scenarios.assemble.behind.readout import refuse_readout
    from scenarios.assemble.schema.loading import linked, load
    from scenarios.assemble.source.link import link_camera

    if out is not None and (out.exists() or not out.absolute().parent.is_dir()):
        raise InputError(
            "--out", "a new folder in one that exists", str(out), "choose another name"
        )
    name, loaded = load(scenario, assignments, seed=seed)
    link = linked(loaded, "link capacity")
    refuse_readout(link, "link capacity")
    camera = link_camera(link)
    given, mode, assumed = scenario_input(link, camera)
    document = capacity_document(given, mode, link.seed)
    progress = make_progress()
    try:
        study, done = CapacityStudy(link, camera, mode, symbols), 0
        curves = () if out is None else CURVES
        progress.start("points", 1 + len(curves) * points)

        def count() -> None:
            nonlocal done
            done += 1
            progress.advance(min(done, 1 + len(curves) * points))

        document |= study.document()
        count()
        document["curves"] = [study.curve(curve, points, count) for curve in curves]
        progress.advance(1 + len(curves) * points)
    finally:
        progress.close()
    document["assumed"] = assumed
    if out is not None:
        _write_capacity(document, out)
    if json:
        print_document(document)
    else:
        print(_capacity_text(name, document))
        if out is not None:
            tell(f"figure: {out / 'capacity.png'}, {out / 'capacity.svg'}")


def _write_capacity(document: dict[str, Any], out: Path) -> None:
    """The folder, whole or not at all."""
    from cosim.files.atomic import atomic_write
    from cosim.run.result import dumps
    from link.report.curves import draw_capacity

    with atomic_write(out) as part:
        part.mkdir()
        for kind in ("png", "svg"):
            draw_capacity(document["curves"], part / f"capacity.{kind}")
        (part / "capacity.json").write_text(dumps(document) + "\n", encoding="utf-8")


def _rate(bps: float) -> str:
    return amount(bps, "bit/s", 4)


def _capacity_text(name: str, document: dict[str, Any]) -> str:
    """The document for a reader."""
    from link.mode import word_code

    given, mode = document["given"], document["mode"]
    assumed = ", ".join(document["assumed"])
    lines = [
        f"{name}: ON {number(given['on'], 4)} e, OFF {number(given['off'], 4)} e a tick, threshold "
        f"{number(given['threshold'])} e, {given['reset']} reset, {number(given['hz'])} ticks/s",
        f"{_cells(mode)}, {mode['line']}, "
        + word_code(mode["parity"], mode["rate"])
        + (f"; not given, so assumed: {assumed}" if assumed else ""),
        "",
    ]
    for key, row in document["pixel"].items():
        span = ""
        if "ci" in row:
            low, high = (number(each, 5) for each in row["ci"])
            span = f" [{low}, {high}]"
        lines.append(f"{key:<9}{number(row['value'], 4):>10} {row['unit']:<11}{row['what']}{span}")
    lines += ["", f"{'':<14}{'factor':>11}{'left':>14}{'of the loss':>13}"]
    for row in document["budget"]:
        lines.append(
            f"{row['name']:<14}{number(row['factor']):>11}{_rate(row['bps']):>14}"
            f"{row['share_of_loss']:12.1%}  {row['what']}"
        )
    share = document["share"]
    lines += [
        "",
        f"capacity of the pixels that see the panel {_rate(document['capacity_bps'])}, of the "
        f"mode's cells {_rate(document['cells_bps'])}, raw {_rate(document['raw_bps'])}, coded, if "
        f"every word were decoded, {_rate(document['coded_bps'])}: "
        + (f"{share:.1%} of capacity" if share is not None else "no light, no capacity"),
        *_achievable(document),
    ]
    return "\n".join(lines)


def _achievable(document: dict[str, Any]) -> list[str]:
    """Lines of the simulated information."""
    best = document["information_best"]
    if best is None:
        return ["achievable information: none, for a receiver cannot find the panel: it is not "
                "wholly in view, or its tags are too small"]  # fmt: skip
    mine = {**document, **document["mode"]}
    coded, high = document["coded_bps"], mine["information_high"]
    short = (
        f"the coded rate, {_rate(coded)}, is above what this mode carries here: take larger cells, "
        "longer symbols or words of a lower rate, as a run does that chooses them itself"
    )
    return [
        f"achievable information, simulated at a phase of {document['phase']:.2f} ticks: "
        f"{_cells(mine)} {_span(mine)}; the best, {_cells(best)}, {_span(best)}",
        *([short] if coded > high else []),
    ]


def _cells(row: dict[str, Any]) -> str:
    length = "1 tick" if row["ticks"] == 1 else f"{row['ticks']} ticks"
    return f"cells of {row['cell']} x {row['cell']}, {length}"


def _span(row: dict[str, Any]) -> str:
    low, high = _rate(row["information_low"]), _rate(row["information_high"])
    return (
        f"{_rate(row['information_bps'])} [{low}, {high}], {row['information_bit']:.4f} bit of a "
        "cell's symbol"
    )
