"""Reports the first error of a scenario in one line."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, get_args

from pydantic import BaseModel, ValidationError

from cosim import InputError
from cosim.errors import quote, shorten
from scenarios.assemble.schema.export import export
from scenarios.assemble.schema.order import check_order
from scenarios.assemble.schema.scenario import AnyScenario, kind_of_data

_NESTED = {"model_type": "a section", "model_attributes_type": "a section", "tuple_type": "a list"}
_MUST = {
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
"""The requirement of a key, by pydantic's type of error; its context fills the braces."""
_OF_KEY: Final = re.compile(r"(?P<key>[a-z_]+) must be (?P<must>.+), not (?P<actual>.+)")
"""What a section says of one of its keys, and of a value that is not repeated."""
KEYS: Final = 200
"""Maximum length of a list of keys in a message, characters."""


@dataclass(frozen=True)
class _Place:
    """A key of the schema.

    Attributes:
        name: its dotted name.
        keys: all keys of its section.
        kinds: keys of each kind of the section that this is, or that it is in, if there are
            several; {} for another place.
    """

    name: str
    keys: tuple[str, ...]
    kinds: Mapping[str, tuple[str, ...]]

    def kind_with(self, keys: Iterable[str]) -> str | None:
        """The kind that has most of these keys; None if none has one."""
        given = set(keys)
        counts = {kind: len(given.intersection(known)) for kind, known in self.kinds.items()}
        best = max(counts, key=lambda kind: counts[kind], default=None)
        return best if best is not None and counts[best] else None


def _sections(annotation: Any) -> tuple[type[BaseModel], ...]:
    """The sections that a field may hold; several for a union."""
    if isinstance(annotation, type):
        return (annotation,) if issubclass(annotation, BaseModel) else ()
    return tuple(s for inner in get_args(annotation) for s in _sections(inner))


def _kind(section: type[BaseModel]) -> str | None:
    """The tag of a section that is a member of a union; None for another section."""
    field = section.model_fields.get("kind")
    return None if field is None else str(get_args(field.annotation)[0])


def _place(loc: tuple[int | str, ...], whole: type[BaseModel]) -> _Place:
    """The dotted name of an error's location, without the tag of a union, and the keys of its
    section."""
    sections: tuple[type[BaseModel], ...] = (whole,)
    names: list[str] = []
    keys, kinds = tuple(whole.model_fields), _kinds(())
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
        if sections:
            kinds = _kinds(sections)
    return _Place(".".join(names), keys, kinds)


def _kinds(sections: tuple[type[BaseModel], ...]) -> dict[str, tuple[str, ...]]:
    """Keys by kind, of a union of sections; {} for another."""
    if len(sections) < 2:
        return {}
    return {str(_kind(section)): tuple(section.model_fields) for section in sections}


def _example(name: str) -> Any:
    """An example of a key's value, None if the schema has none."""
    node: dict[str, Any] = export()
    for part in name.split("."):
        node = _resolve(node).get("properties", {}).get(part, {})
    field = _resolve(node)
    return (field.get("examples") or field.get("enum") or [field.get("const")])[0]


def _listed(name: str, what: str) -> str:
    """What a value must be, with an example: "a list such as [100, 200]". name: dotted, with the
    numbers of entries of a list."""
    parts = name.split(".")
    count = next((n for n, part in enumerate(parts) if part.isdigit()), len(parts))
    example = _example(".".join(parts[:count]))
    if isinstance(example, str):
        with suppress(ValueError):
            example = json.loads(example)
    for _ in parts[count:]:
        example = example[0] if isinstance(example, list) and example else None
    shown = isinstance(example, list if what == "a list" else dict)
    return f"{what} such as {json.dumps(example)}" if shown else what


def _remedy(name: str) -> str:
    """An instruction that shows a valid value of a key."""
    example = _example(name)
    if example is None:
        return "see `viform list --keys`"
    text = f"'{json.dumps(example)}'" if isinstance(example, list) else repr(example)
    return f"write --set {name}={text}"


def _with_example(must: str, name: str) -> str:
    """`must`, with the example of the key in place of that of its quantity: a distance in metres
    and the micrometres of a pixel are the same quantity."""
    example = _example(name)
    if not isinstance(example, str):
        return must
    return re.sub(r"(such as )'[^']*'", lambda match: f"{match[1]}{example!r}", must, count=1)


def _resolve(node: dict[str, Any]) -> dict[str, Any]:
    """Follows references; at a union, merges the properties of all members."""
    definitions = export()["$defs"]
    if "$ref" in node:
        return _resolve(definitions[node["$ref"].rsplit("/", 1)[1]])
    alternatives = node.get("oneOf") or node.get("anyOf")
    if alternatives:
        merged: dict[str, Any] = {"properties": {}}
        if "examples" in node:  # the examples of the field precede those of its type
            merged["examples"] = node["examples"]
        for inner in map(_resolve, alternatives):
            merged["properties"] = inner.get("properties", {}) | merged["properties"]
            if "examples" in inner:
                merged.setdefault("examples", inner["examples"])
        return merged
    return node


def _holder(data: Any, loc: tuple[int | str, ...]) -> Mapping[str, Any]:
    """The section of a document that holds the key of an error; {} without a document."""
    for part in loc[:-1]:
        inner = range(len(data)) if isinstance(data, list) else data
        if isinstance(inner, range | Mapping) and part in inner:  # the tag of a union is no key
            data = data[part]
    return data if isinstance(data, Mapping) else {}


def _sections_with(key: str, whole: type[BaseModel]) -> Iterator[str]:
    """The sections of a scenario that have a key of this name."""
    for name, field in whole.model_fields.items():
        if any(key in section.model_fields for section in _sections(field.annotation)):
            yield name


def _one_line(error: Any, whole: type[BaseModel], data: Any = None) -> InputError:
    """An error of pydantic for the schema `whole`, with requirement, value and remedy.

    data: the document; None if it is not to be asked what else a section has.
    """
    place = _place(error["loc"], whole)
    value, kind = quote(error["input"]), error["type"]
    if kind == "extra_forbidden":
        key = place.name.rsplit(".", 1)[-1]
        near = difflib.get_close_matches(key, place.keys, 1)
        section = place.name.rpartition(".")[0]
        other = place.kind_with([key])
        if other is not None and not near:
            # Another kind is proposed only if it has all keys: a second one would lead back.
            given = {name for name in _holder(data, error["loc"]) if name != "kind"} | {key}
            fits = next((kind for kind, known in place.kinds.items() if given <= {*known}), None)
            return InputError(
                place.name, f"given with {section}.kind = {fits or other}", "with another kind",
                "remove it" if fits is None else f"set {section}.kind={fits}, or remove it",
            )  # fmt: skip
        remedy = (
            f"did you mean {f'{section}.' if section else ''}{near[0]}?" if near else "remove it"
        )
        inside = [] if section or near else [*_sections_with(key, whole)]
        if inside:  # such as the size of a chip
            remedy = f"did you mean {' or '.join(f'{name}.{key}' for name in inside[:2])}?"
        # The keys of the section are listed only if none of them resembles the unknown key.
        must = "a key that is known" if near else shorten(f"one of {', '.join(place.keys)}", KEYS)
        return InputError(shorten(place.name), must, "an unknown key", remedy)
    if kind in ("missing", "union_tag_not_found"):
        if kind != "union_tag_not_found":
            return InputError(place.name, "given", "absent", _remedy(place.name))
        name = f"{place.name}.kind"
        best = place.kind_with(error["input"])
        remedy = _remedy(name) if best is None else f"write --set {name}={best!r}"
        return InputError(name, "given", "absent", remedy)
    text = error["msg"].removeprefix("Value error, ").strip()
    of_key = _OF_KEY.fullmatch(text) if isinstance(error["input"], dict) else None
    if of_key is not None:  # a section whose keys do not fit each other
        name, limit = f"{place.name}.{of_key['key']}", of_key["must"].startswith("at ")
        remedy = f"write that, or change other keys of {place.name}" if limit else _remedy(name)
        return InputError(name, of_key["must"], of_key["actual"], remedy)
    if text.startswith("must be "):
        must = _with_example(text.removeprefix("must be "), place.name)
        return InputError(place.name, must, value, _remedy(place.name))
    if kind == "union_tag_invalid":
        wanted, tag = error["ctx"]["expected_tags"], quote(error["ctx"]["tag"])
        return InputError(f"{place.name}.kind", f"one of {wanted}", tag, "choose one")
    must = _MUST[kind].format(**error.get("ctx", {})) if kind in _MUST else text.lower()
    if kind in _NESTED:
        must = _listed(place.name, _NESTED[kind])
    return InputError(place.name, must, value, _remedy(place.name))


def validate(data: dict[str, Any]) -> AnyScenario:
    """Checks the data of a scenario.

    Its sections select the kind of scenario (`KINDS` in scenario.py). Raises InputError with one
    error in one line: the first wrong value, else the first key that is missing.
    """
    if not data:
        raise InputError(
            "the scenario", "a title and sections such as [scene] and [sensor]", "empty",
            "begin with the scenario.toml of a run",
        )  # fmt: skip
    check_order(data)
    whole = kind_of_data(data).whole()
    try:
        return whole.model_validate(data)
    except ValidationError as exc:
        # what is wrong says more than what is missing: a kind that does not exist, not the title
        error = min(exc.errors(), key=lambda error: error["type"] == "missing")
        raise _one_line(error, whole, data) from None


def first_fault(exc: ValidationError, whole: type[BaseModel], remedy: str) -> InputError:
    """The first error of a document other than a scenario, in one line.

    Args:
        exc: the error of pydantic.
        whole: the schema of the document.
        remedy: the remedy for errors other than an unknown key.
    """
    error = exc.errors()[0]
    fault = _one_line(error, whole)  # its examples are those of scenarios
    unknown_key = error["type"] == "extra_forbidden"
    return InputError(fault.what, fault.must, fault.actual, fault.remedy if unknown_key else remedy)
