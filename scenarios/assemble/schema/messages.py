"""One line about the first thing that is wrong with a scenario."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from typing import Any, Final, get_args

from pydantic import BaseModel, ValidationError

from cosim import InputError
from cosim.errors import quote, shorten
from scenarios.assemble.schema.scenario import (
    AnyScenario,
    BoardScenario,
    LinkScenario,
    Scenario,
    export,
    imager_scenario,
)

__all__ = ["first_fault", "validate"]


@dataclass(frozen=True)
class _Place:
    """A key of the schema: its dotted name and the section it belongs to."""

    name: str
    keys: tuple[str, ...]


def _sections(annotation: Any) -> tuple[type[BaseModel], ...]:
    """The sections that a field may hold: one, one or none, or one of several kinds."""
    if isinstance(annotation, type):
        return (annotation,) if issubclass(annotation, BaseModel) else ()
    return tuple(s for inner in get_args(annotation) for s in _sections(inner))


def _kind(section: type[BaseModel]) -> str | None:
    """The tag of one kind of a section that comes in several."""
    field = section.model_fields.get("kind")
    return None if field is None else str(get_args(field.annotation)[0])


def _place(loc: tuple[int | str, ...], whole: type[BaseModel]) -> _Place:
    """Dotted name of an error's location (without a union's tag) and its section's keys."""
    sections: tuple[type[BaseModel], ...] = (whole,)
    names: list[str] = []
    keys = tuple(whole.model_fields)
    for part in loc:
        tagged = tuple(s for s in sections if len(sections) > 1 and _kind(s) == part)
        if tagged:
            sections, keys = tagged, tuple(tagged[0].model_fields)
            continue
        names.append(str(part))
        if len(sections) != 1:
            continue
        keys = tuple(sections[0].model_fields)
        field = sections[0].model_fields.get(str(part))
        sections = () if field is None else _sections(field.annotation)
    return _Place(".".join(names), keys)


def _found(name: str) -> Any:
    """What may be written for a key, None where the schema does not show it."""
    node: dict[str, Any] = export()
    for part in name.split("."):
        node = _resolve(node).get("properties", {}).get(part, {})
    found = _resolve(node)
    return (found.get("examples") or found.get("enum") or [found.get("const")])[0]


def _example(name: str) -> str:
    """An instruction that shows what to write for a key."""
    found = _found(name)
    return "see `viform list --schema`" if found is None else f"write --set {name}={found!r}"


def _own_example(must: str, name: str) -> str:
    """What a quantity must be, with the key's own example in the place of its kind's: a distance in
    metres is of the same kind as a pixel's micrometres."""
    found = _found(name)
    if not isinstance(found, str):
        return must
    return re.sub(r"(such as )'[^']*'", lambda match: f"{match[1]}{found!r}", must, count=1)


def _resolve(node: dict[str, Any]) -> dict[str, Any]:
    """Follows references and the first alternative; all scenes' properties at a union."""
    definitions = export()["$defs"]
    if "$ref" in node:
        return _resolve(definitions[node["$ref"].rsplit("/", 1)[1]])
    alternatives = node.get("oneOf") or node.get("anyOf")
    if alternatives:
        merged: dict[str, Any] = {"properties": {}}
        if "examples" in node:  # the field's own go before its type's
            merged["examples"] = node["examples"]
        for inner in map(_resolve, alternatives):
            merged["properties"] = inner.get("properties", {}) | merged["properties"]
            if "examples" in inner:
                merged.setdefault("examples", inner["examples"])
        return merged
    return node


_MUST = {
    "model_type": "a section",
    "model_attributes_type": "a section",
    "tuple_type": "a list such as [100, 200]",
    "string_type": "text",
    "string_unicode": "text in UTF-8",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number of fewer digits",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "greater_than": "above {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "below {lt}",
    "less_than_equal": "at most {le:g}",
    "multiple_of": "a multiple of {multiple_of:g}",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "literal_error": "{expected}",
}
"""What a key must be, by pydantic's type of error; the braces are filled from its context."""

KEYS: Final = 200
"""Characters of a list of keys that a message names, at most."""


def _one_line(error: Any, whole: type[BaseModel]) -> InputError:
    """The first error of a validation as what must be, what was given, how to correct it."""
    place = _place(error["loc"], whole)
    given, kind = quote(error["input"]), error["type"]
    if kind == "extra_forbidden":
        key = place.name.rsplit(".", 1)[-1]
        near = difflib.get_close_matches(key, place.keys, 1)
        section = place.name.rpartition(".")[0]
        remedy = (
            f"did you mean {f'{section}.' if section else ''}{near[0]}?" if near else "remove it"
        )
        # A section's keys are listed only where none of them looks like what was meant.
        must = "a key that is known" if near else shorten(f"one of {', '.join(place.keys)}", KEYS)
        return InputError(shorten(place.name), must, "an unknown key", remedy)
    if kind in ("missing", "union_tag_not_found"):
        name = f"{place.name}.kind" if kind == "union_tag_not_found" else place.name
        return InputError(name, "given", "absent", _example(name))
    text = error["msg"].removeprefix("Value error, ").strip()
    if text.startswith("must be "):
        must = _own_example(text.removeprefix("must be "), place.name)
        return InputError(place.name, must, given, _example(place.name))
    if kind == "union_tag_invalid":
        wanted, tag = error["ctx"]["expected_tags"], quote(error["ctx"]["tag"])
        return InputError(f"{place.name}.kind", f"one of {wanted}", tag, "choose one")
    must = _MUST[kind].format(**error.get("ctx", {})) if kind in _MUST else text.lower()
    if kind == "tuple_type" and place.name == "display.beside":
        must = 'a list such as ["60 Hz", "120 Hz"]'
    return InputError(place.name, must, given, _example(place.name))


def validate(data: dict[str, Any]) -> AnyScenario:
    """A checked scenario: with [board] one of a board, with [imager] one of an imager, with [link]
    one of a link, else one of a spike camera. Raises InputError with one line about the first thing
    that is wrong."""
    if "link" in data and "scene" in data:
        raise InputError(
            "link", "absent in a scenario with a [scene]", "beside one",
            "take one of them out: a stream does not cross a link yet",
        )  # fmt: skip
    for other in ("sensor", "display", "image", "link"):
        if "imager" in data and other in data:
            raise InputError(
                "imager", f"absent in a scenario with [{other}]", "beside it",
                "take one of them out: an [imager] stands alone before its [scene]",
            )  # fmt: skip
    for other in ("scene", "link", "sensor", "imager"):
        if "board" in data and other in data:
            raise InputError(
                "board", f"absent in a scenario with a [{other}]", "beside one",
                "take one of them out: bring-up.toml has a [board] alone",
            )  # fmt: skip
    whole: type[AnyScenario] = Scenario
    if "board" in data:
        whole = BoardScenario
    elif "imager" in data:
        whole = imager_scenario()
    elif "link" in data:
        whole = LinkScenario
    try:
        return whole.model_validate(data)
    except ValidationError as exc:
        raise _one_line(exc.errors()[0], whole) from None


def first_fault(exc: ValidationError, whole: type[BaseModel], remedy: str) -> InputError:
    """The first error of a document that is no scenario, as one line. remedy: what to do, where the
    key alone does not tell."""
    error = exc.errors()[0]
    # The examples of `_one_line` are those of scenarios.
    found = _one_line(error, whole)
    known = error["type"] == "extra_forbidden"
    return InputError(found.what, found.must, found.actual, found.remedy if known else remedy)
