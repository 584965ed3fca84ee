"""`viform list`: the scenarios of the package, and the keys and the schema of scenarios."""

from __future__ import annotations

import tomllib
from dataclasses import asdict
from typing import Annotated

import typer

from cosim import InputError
from scenarios.cli.output import Json, print_document, tell


def list_scenarios(
    prefix: Annotated[
        str | None,
        typer.Argument(help="beginning of the keys that --keys names, such as link.panel"),
    ] = None,
    keys: Annotated[
        bool, typer.Option("--keys", help="list the keys of scenarios, a line each, instead")
    ] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="print the JSON Schema of scenarios instead")
    ] = False,
    json: Json = False,
) -> None:
    """List the scenarios of the package."""
    from scenarios.assemble.schema.export import export
    from scenarios.assemble.schema.loading import shipped

    if keys:
        _list_keys(prefix or "", json)
        return
    if prefix is not None:
        raise InputError("PREFIX", "given with --keys alone", prefix, "add --keys, or leave it out")
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
        tell(f"{row['name']:<{wide}} {row['title']}")


def _list_keys(prefix: str, json: bool) -> None:
    from scenarios.assemble.schema.keys import keys

    found = [key for key in keys() if key.name.startswith(prefix)]
    if not found:
        raise InputError(
            "PREFIX", "the beginning of a key, such as link.panel", prefix,
            "see all keys: viform list --keys",
        )  # fmt: skip
    if json:
        print_document({"keys": [asdict(key) for key in found]})
        return
    for key in found:
        tell(key)
