"""`viform bench`: throughput on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenarios.commands.output import Json, print_document

__all__ = ["bench"]

CODE = "code"


def _bench_code(device: str | None, figure: Path | None, json: bool) -> None:
    from cosim.files.whole import whole
    from scenarios.code_bench import bench_code, draw, markdown
    from scenarios.run import choose_device

    if figure is not None and figure.suffix.lower() != ".png":
        from cosim import InputError

        raise InputError("--figure", "a name ending in .png", str(figure), "give it one")
    document = bench_code(choose_device(device))
    if figure is not None:
        with whole(figure) as part:
            draw(document, part)
    if json:
        print_document(document)
    else:
        print(markdown(document))


def bench(
    part: Annotated[
        str | None, typer.Argument(help="one part alone, such as sensor; code: sizes of streams")
    ] = None,
    device: Annotated[
        str | None, typer.Option(help="part of an OpenCL device's name, or numba")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="of code: PNG to draw")] = None,
    json: Json = False,
) -> None:
    """Measure throughput against real time, a measured ceiling and the plain way.

    `bench code` measures no time but how small streams become; it takes minutes.
    """
    from cosim import InputError
    from scenarios.bench import PARTS
    from scenarios.bench import bench as measure
    from scenarios.run import choose_device

    if part is not None and part not in (*PARTS, CODE):
        raise InputError(
            "the part", f"one of {', '.join((*PARTS, CODE))}", repr(part), "leave it out for all"
        )
    if figure is not None and part != CODE:
        raise InputError("--figure", "given with bench code", "without", "leave it out")
    if part == CODE:
        _bench_code(device, figure, json)
        return
    document = measure(choose_device(device), [part] if part else list(PARTS))
    if json:
        print_document(document)
        return
    ceiling = document["ceiling"]
    print(document["device"])
    if ceiling["value"] is not None:
        print(f"ceiling {ceiling['value']:.3g} {ceiling['unit']}: {ceiling['what']}")
    names = f"{'x real time':>11} {'x ceiling':>10} {'x plain':>8}"
    print(f"{'':<16} {'tier':<7} {'':>9} {'':<15} {names}")
    for row in document["rows"]:
        share = "" if row["ceiling_ratio"] is None else f"{row['ceiling_ratio']:.3f}"
        print(
            f"{row['name']:<16} {row['tier']:<7} {row['value']:9.3g} {row['unit']:<15} "
            f"{row['realtime']:11.3g} {share:>10} {row['plain_ratio']:8.1f}"
        )
