"""The keys of scenarios as a list, one line a key: `viform list --keys` and docs/keys.md, which
`python -m scenarios.assemble.schema.keys > docs/keys.md` writes."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from cosim.config.units import KINDS as QUANTITIES
from scenarios.assemble.schema.export import export
from scenarios.assemble.schema.scenario import KINDS

_QUANTITIES = frozenset(map(str, QUANTITIES.values()))
_TYPES = {"integer": "a whole number", "number": "a number", "string": "text",
          "boolean": "true or false", "array": "a list", "object": "a section"}  # fmt: skip
_LIMITS = {"exclusiveMinimum": "above", "minimum": "at least", "exclusiveMaximum": "below",
           "maximum": "at most", "multipleOf": "a multiple of"}  # fmt: skip


@dataclass(frozen=True)
class Key:
    """A key of a scenario.

    Attributes:
        name: name with its sections, "link.panel.pitch"; "sensor.writes[].at" is a key of each item
            of a list.
        of: the kinds that have the key: of its section ("film" of `scene`) or of the scenario
            ("link"); () for all that have the section.
        accepts: the values that are accepted, "a length such as '500 um', above 0 um".
        default: the default as JSON; None if the key has none and must be given.
        meaning: what the key means, "" if its name says it.
    """

    name: str
    of: tuple[str, ...]
    accepts: str
    default: str | None
    meaning: str

    def __str__(self) -> str:
        kinds = f" ({', '.join(self.of)})" if self.of else ""
        default = "required" if self.default is None else f"default {self.default}"
        return "; ".join(part for part in (
            f"{self.name}{kinds}: {self.accepts}", default, self.meaning
        ) if part)  # fmt: skip


def _resolved(node: dict[str, Any]) -> dict[str, Any]:
    if "$ref" not in node:
        return node
    rest = {key: value for key, value in node.items() if key != "$ref"}
    target: dict[str, Any] = export()["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return target | rest


def _choices(node: dict[str, Any]) -> list[dict[str, Any]]:
    """The alternatives of a node, without null."""
    node = _resolved(node)
    inner = node.get("oneOf") or node.get("anyOf")
    if not inner:
        return [node]
    return [one for part in inner for one in _choices(part) if one.get("type") != "null"]


def _one(node: dict[str, Any], example: str | None) -> str:
    """What one alternative accepts."""
    if "const" in node:
        return json.dumps(node["const"], ensure_ascii=False)
    if "enum" in node:
        return " or ".join(json.dumps(value, ensure_ascii=False) for value in node["enum"])
    quantity = node.get("quantity")
    if quantity is None:
        text, limits = _TYPES[node["type"]], {word: node.get(word) for word in _LIMITS}
        if example is not None and node["type"] in ("string", "array"):
            text += f" such as {example}"
    else:
        kind = QUANTITIES[quantity["kind"]]
        given = example or f"'{kind.example}'"
        text = str(kind).replace(f"'{kind.example}'", given.replace('"', "'"))
        limits = {word: quantity.get(word) for word in _LIMITS}
    said = [f"{word} {limits[key]}" for key, word in _LIMITS.items() if limits[key] is not None]
    if quantity is not None and quantity["none"]:
        said.append("or 'none'")
    if node["type"] == "array" and "maxItems" in node:
        said.append(f"at most {node['maxItems']} items")
    return ", ".join([text, *said])


def _accepts(node: dict[str, Any], default: Any) -> str:
    examples = _resolved(node).get("examples")
    texts = []
    for one in _choices(node):
        example = next(iter(examples or one.get("examples") or ()), None)
        given = None if example is None else json.dumps(example, ensure_ascii=False)
        texts.append(_one(one, given))
    if default is None and "default" in node:
        texts.append("absent")
    return " or ".join(dict.fromkeys(texts))


def _walk(node: dict[str, Any], at: str, kind: str) -> Iterator[tuple[Key, str]]:
    """All keys below a node, each with the kind that has it."""
    required = node.get("required", ())
    for name, inner in node["properties"].items():
        path = f"{at}.{name}" if at else name
        for one in _choices(inner):
            item = _resolved(one.get("items", {}))
            if "properties" in item:
                yield from _walk(item, f"{path}[]", kind)
        sections = [one for one in _choices(inner) if "properties" in one]
        for section in sections:
            own = section["properties"].get("kind", {}).get("const", kind)
            yield from _walk(section, path, own)
        if sections and all(one in sections for one in _choices(inner)):
            continue
        rest = [one for one in _choices(inner) if one not in sections]
        default = inner.get("default")
        shown = None if name in required else json.dumps(default, ensure_ascii=False)
        accepts = _accepts({**inner, "anyOf": rest} if sections else inner, default)
        meaning = _resolved(inner).get("description", "")
        if meaning in _QUANTITIES:  # which `accepts` has
            meaning = ""
        yield Key(path, (), accepts, "none" if shown == "null" else shown, meaning), kind


@cache
def keys() -> tuple[Key, ...]:
    """All keys of all kinds of scenarios, by name."""
    kinds: dict[Key, list[str]] = {}
    for node, kind in zip(export()["anyOf"], KINDS, strict=True):
        for key, one in _walk(_resolved(node), "", kind.name):
            kinds.setdefault(key, []).append(one)
    scenarios = {kind.name for kind in KINDS}
    forms = Counter(key.name for key in kinds)
    found = []
    for key, of in kinds.items():
        everywhere = forms[key.name] == 1 and set(of) <= scenarios
        found.append(replace(key, of=() if everywhere else tuple(dict.fromkeys(of))))
    return tuple(sorted(found, key=lambda key: key.name))


def table() -> str:
    """docs/keys.md: the keys in a table for each section."""
    lines = [
        "# Keys of scenarios", "",
        "This file is generated from the schema of scenarios by",
        "`python -m scenarios.assemble.schema.keys`; do not edit it. `viform list --keys PREFIX`",
        "prints the keys that begin so. In TOML, `link.panel.pitch` is the key `pitch` of the",
        "section `[link.panel]`; on the command line it is `--set link.panel.pitch='500 um'`.",
        "A key that several kinds of a section have in different forms has a row for each.",
    ]  # fmt: skip
    section = None
    for key in sorted(keys(), key=lambda key: key.name.rpartition(".")[::2]):
        at, _, name = key.name.rpartition(".")
        if at != section:
            header = f"[[{at.removesuffix('[]')}]]" if at.endswith("[]") else f"[{at}]"
            title = f"`{header}`" if at else "Before the first section"
            lines += ["", f"## {title}", "", "| key | of kind | accepts | default | meaning |"]
            lines.append("|---|---|---|---|---|")
            section = at
        default = "required" if key.default is None else f"`{key.default}`"
        cells = name, ", ".join(key.of), key.accepts, default, key.meaning
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(table(), end="")
