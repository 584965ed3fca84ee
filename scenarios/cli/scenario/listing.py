"""`viform list`: the scenarios of the package, and the schema of scenarios."""

from __future__ import annotations

import tomllib
from typing import Annotated

import typer

from scenarios.cli.output import Json, print_document

__all__ = ["list_scenarios"]


def list_scenarios(
    schema: Annotated[
        bool, typer.Option("--schema", help="print the JSON Schema of scenarios instead")
    ] = False,
    json: Json = False,
) -> None:
    """List the scenarios of the package."""
    from scenarios.assemble.schema.loading import shipped
    from scenarios.assemble.schema.scenario import export

    if schema:
        print_document(export())
        return
    rows = [
        {"name": name, "title": tomllib.loads(text)["title"]} for name, text in shipped().items()
    ]
    if json:
        print_document({"scenarios": rows})
        return
    wide = max(len(row["name"]) for row in rows)
    for row in rows:
        print(f"{row['name']:<{wide}} {row['title']}")
