"""`viform link capacity`: what a link's light and pixels could carry, and what its design does.

The functions import what they need: the start of other commands must not wait for it.
"""

from __future__ import annotations

from typing import Annotated, Any

import typer

from scenarios.cli.output import Json, print_document

__all__ = ["link_capacity"]


def link_capacity(
    scenario: Annotated[
        str, typer.Argument(help="a link's scenario: a name, a TOML file, or the folder of a run")
    ] = "light-link",
    assignments: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="override a key")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="of the scenario, and of Monte Carlo")] = None,
    json: Json = False,
) -> None:
    """Tell how far a link's design is from capacity, and what costs what.

    No light is simulated: levels are the air's closed forms. Parts of the mode that a run would
    choose from a pilot are 2 x 2 cells, 1 tick, scrambled and 32 parity bytes; name others with
    --set link.modem.cell=1 and the like.
    """
    from link.prediction.capacity import capacity_document
    from link.prediction.capacity_input import scenario_input
    from scenarios.assemble.link import link_camera
    from scenarios.assemble.schema.loading import linked, load

    name, loaded = load(scenario, assignments, seed=seed)
    link = linked(loaded, "link capacity")
    given, mode, assumed = scenario_input(link, link_camera(link))
    document = capacity_document(given, mode, link.seed)
    document["assumed"] = assumed
    if json:
        print_document(document)
    else:
        print(_text(name, document))


def _rate(bps: float) -> str:
    for size, unit in ((1e9, "Gb/s"), (1e6, "Mb/s"), (1e3, "kb/s")):
        if bps >= size:
            return f"{bps / size:.3f} {unit}"
    return f"{bps:.3g} b/s"


def _text(name: str, document: dict[str, Any]) -> str:
    """The document for a reader."""
    from link.mode import word_code

    given, mode = document["given"], document["mode"]
    assumed = ", ".join(document["assumed"])
    lines = [
        f"{name}: ON {given['on']:.4g} e, OFF {given['off']:.4g} e a tick, threshold "
        f"{given['threshold']:g} e, {given['reset']} reset, {given['hz']:g} ticks/s",
        f"cells of {mode['cell']} x {mode['cell']}, {mode['ticks']} ticks, {mode['line']}, "
        + word_code(mode["parity"], mode["rate"])
        + (f"; not given, so assumed: {assumed}" if assumed else ""),
        "",
    ]
    for key, row in document["pixel"].items():
        span = " [{:.5g}, {:.5g}]".format(*row["ci"]) if "ci" in row else ""
        lines.append(f"{key:<9}{row['value']:10.4g} {row['unit']:<11}{row['what']}{span}")
    lines += ["", f"{'':<14}{'factor':>8}{'left':>14}{'of the loss':>13}"]
    for row in document["budget"]:
        lines.append(
            f"{row['name']:<14}{row['factor']:8.3f}{_rate(row['bps']):>14}"
            f"{row['share_of_loss']:12.1%}  {row['what']}"
        )
    share = document["share"]
    lines += [
        "",
        f"capacity of the pixels that see the panel {_rate(document['capacity_bps'])}, of the "
        f"mode's cells {_rate(document['cells_bps'])}, raw {_rate(document['raw_bps'])}, coded "
        f"{_rate(document['coded_bps'])}: "
        + (f"{share:.1%} of capacity" if share is not None else "no light, no capacity"),
    ]
    return "\n".join(lines)
