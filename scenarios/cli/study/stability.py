"""`viform stability`: stiff and extreme cases, compared with references."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from cosim.config.amounts import number
from scenarios.cli.options import Device
from scenarios.cli.output import Json, print_document, tell


def stability(
    cases: Annotated[
        list[str] | None,
        typer.Argument(metavar="[CASE ...]", help="numbers of the cases; all by default"),
    ] = None,
    device: Device = None,
    json: Json = False,
) -> None:
    """Compare extreme cases with independent references; exit 0 if all agree."""
    from dataclasses import asdict

    from cosim import InputError
    from cosim.compute.opencl import choose_device
    from scenarios.studies.stability import CASES

    known = {str(key): case for key, case in CASES.items()}
    for key in cases or []:
        if key not in known:
            raise InputError(
                "a case",
                f"one of {', '.join(known)}",
                repr(key),
                "leave the numbers out to run all",
            )
    chosen = [known[key] for key in dict.fromkeys(cases or known)]
    target, rows = choose_device(device), []
    for n, case in enumerate(chosen, 1):
        text = f"viform: {n}/{len(chosen)} case {case.number}, {case.name}:"
        print(text, end=" ", file=sys.stderr, flush=True)
        row = case.measure(target)
        rows.append(row)
        print(f"{'holds' if row.holds else 'FAILS'}, {row.seconds:.1f} s", file=sys.stderr)
    if json:
        print_document({"rows": [asdict(row) for row in rows]})
    else:
        width = max(len(row.name) for row in rows)
        tell(f"{'case':>4} {'':<{width}}  {'':<5} {'value':>9} {'limit':>9} unit")
        for row in rows:
            value = "none" if row.value is None else number(row.value)
            limit = "" if row.limit is None else number(row.limit)
            mark = "holds" if row.holds else "FAILS"
            tell(f"{row.case:>4} {row.name:<{width}}  {mark} {value:>9} {limit:>9} {row.unit}")
    if not all(row.holds for row in rows):
        raise typer.Exit(1)
