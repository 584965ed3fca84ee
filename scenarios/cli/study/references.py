"""The simulation beside what is known: every number of the source documents (`viform paper`), and
references of stiff and extreme cases (`viform stability`)."""

from __future__ import annotations

import sys
from collections import Counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.config.amounts import number
from scenarios.cli.options import Device
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from cosim.run.printed import PrintedRow


_WORDS = {"=": "", "<": "below", "<=": "at most", ">": "above", ">=": "at least"}


def paper(
    documents: Annotated[
        list[str] | None,
        typer.Argument(metavar="[DOCUMENT ...]", help="000 to 004; all by default"),
    ] = None,
    json: Json = False,
) -> None:
    """Compare every number in the source documents with the simulation; exit 0 if all agree."""
    from dataclasses import asdict

    from cosim import InputError
    from scenarios.studies.paper import DOCUMENTS, paper_rows

    for name in documents or []:
        if name not in DOCUMENTS:
            raise InputError(
                "a document", f"one of {', '.join(DOCUMENTS)}", repr(name),
                "leave the numbers out for all",
            )  # fmt: skip
    chosen = tuple(dict.fromkeys(documents or DOCUMENTS))
    rows = list(paper_rows(chosen))
    if json:
        print_document({"rows": [asdict(row) for row in rows]})
    else:
        for name in chosen:
            selected = [row for row in rows if row.source.startswith(name)]
            print(_table(f"{name}: {DOCUMENTS[name].title}", selected))
        tell(f"{sum(row.holds for row in rows)} of {len(rows)} rows hold; {_sources(rows)}")
    if not all(row.holds for row in rows):
        raise typer.Exit(1)


def _sources(rows: list[PrintedRow]) -> str:
    """How many rows each kind of computation gives."""
    return ", ".join(f"{count} by {by}" for by, count in Counter(r.by for r in rows).most_common())


def _text(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_text(each) for each in value)
    if isinstance(value, bool) or value is None:
        return {None: "none", True: "yes", False: "no"}[value]
    return number(value, 6) if isinstance(value, float | int) else str(value)


def _table(title: str, rows: list[PrintedRow]) -> str:
    """The rows of one document as text: place, quantity, printed value, computed value, what
    computed it, and the reason for a difference."""
    cells = [
        (
            row.source[4:],
            row.what,
            "-" if row.printed is None else f"{_WORDS[row.relation]} {_text(row.printed)}".strip(),
            f"{_text(row.computed)} {'' if row.unit == '1' else row.unit}".strip(),
            row.by,
            "" if row.holds else "FAILS",
            row.note,
        )
        for row in rows
    ]
    heads = ("place", "quantity", "printed", "computed", "by")
    widths = [max(len(c[n]) for c in (heads, *cells)) for n in range(5)]
    lines = [title, "  " + "  ".join(h.ljust(w) for h, w in zip(heads, widths, strict=False))]
    for *columns, mark, note in cells:
        lines.append("  " + "  ".join(c.ljust(w) for c, w in zip(columns, widths, strict=True)))
        lines[-1] = f"{lines[-1]}  {mark}".rstrip()
        if note:
            lines.append(f"      {note}")
    return "\n".join([*lines, ""])


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
