"""`viform bench`: throughput on this machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.config.amounts import amount, number
from scenarios.cli.options import Device, check_figure
from scenarios.cli.output import Json, print_document, tell

Study = tuple[dict[str, Any], str, Callable[[Path], object]]
"""The document of a study, its tables as text, and the function that draws its figure."""


def _code(device: str | None) -> Study:
    """The study of stream sizes."""
    from cosim.compute.opencl import choose_device
    from scenarios.studies.codes import bench_code, draw, markdown

    document = bench_code(choose_device(device))
    return document, markdown(document), lambda part: draw(document, part)


def _continuous(device: str | None) -> Study:
    """The study of continuous photographing against spikes."""
    from dataclasses import asdict

    from cosim.compute.opencl import choose_device
    from scenarios.studies.continuous import compare, markdown, traces_figure

    rows = compare(device=choose_device(device))
    return {"rows": [asdict(row) for row in rows]}, markdown(rows), traces_figure


def _events(device: str | None) -> Study:
    """The study of what the event path of a board carries; it needs no device."""
    from scenarios.studies.events import bench_events, draw, markdown

    document = bench_events()
    return document, markdown(document), lambda part: draw(document, part)


STUDIES = {"code": _code, "continuous": _continuous, "events": _events}


def _print_study(name: str, device: str | None, figure: Path | None, json: bool) -> None:
    from cosim.files.atomic import atomic_write

    check_figure(figure)
    document, tables, draw = STUDIES[name](device)
    if figure is not None:
        with atomic_write(figure) as part:
            draw(part)
    if json:
        print_document(document)
    else:
        print(tables)


def bench(
    part: Annotated[
        str | None,
        typer.Argument(
            help="one part only, such as sensor; board: a simulated board over UDP; growth: by "
            "number of pixels and cycles; view: answers of viform view, with 2.2 GB of disk; code: "
            "sizes of streams; continuous: absolute intensities against spikes; events: what the "
            "event path of a board carries"
        ),
    ] = None,
    device: Device = None,
    figure: Annotated[
        Path | None, typer.Option(help="PNG to draw, for code, continuous and events")
    ] = None,
    json: Json = False,
) -> None:
    """Measure throughput against real time, a measured ceiling and a plain implementation.

    `bench code` measures the compressed sizes of streams and takes minutes; `bench continuous`
    compares continuous photographing with spikes for the same light; `bench events` runs the event
    path of a board.
    """
    from cosim import InputError
    from cosim.compute.opencl import choose_device
    from scenarios.studies.bench.sensor import LARGE, PARTS
    from scenarios.studies.bench.sensor import bench as measure

    known = (*PARTS, *STUDIES)
    if part is not None and part not in known:
        raise InputError(
            "the part", f"one of {', '.join(known)}", repr(part), "leave it out for all"
        )
    if part is not None and part in STUDIES:
        _print_study(part, device, figure, json)
        return
    if figure is not None:
        drawn = "bench " + ", ".join(STUDIES)
        raise InputError("--figure", f"given with {drawn}", "without", "leave it out")
    usual = [name for name in PARTS if name not in LARGE]
    document = measure(choose_device(device), [part] if part else usual)
    if json:
        print_document(document)
        return
    _print_rows(document)


def _print_rows(document: dict[str, Any]) -> None:
    """Prints the document of `bench`."""
    ceiling = document["ceiling"]
    tell(document["device"])
    if ceiling["value"] is not None:
        tell(f"ceiling {amount(ceiling['value'], ceiling['unit'])}: {ceiling['what']}")
    names = f"{'x real time':>11} {'x ceiling':>10} {'x plain':>8} {'share':>8}"
    wide = max(len(row["tier"]) for row in document["rows"])
    tell(f"{'':<20} {'tier':<{wide}} {'':<25} {names}")
    for row in document["rows"]:
        real, limit, plain, share = (
            "" if row.get(key) is None else number(row[key])
            for key in ("realtime", "ceiling_ratio", "plain_ratio", "share")
        )
        tell(
            f"{row['name']:<20} {row['tier']:<{wide}} {amount(row['value'], row['unit']):<25} "
            f"{real:>11} {limit:>10} {plain:>8} {share:>8}".rstrip()
        )
