"""Texts of errors for someone who calls from Python.

The parts name what a user can mend by the options of the commands. In errors of Python,
`--set a.b=c` becomes `**{"a.b": "c"}`, and `--option value` an argument of that name.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature
from typing import Any, ParamSpec, TypeVar, overload

from cosim import InputError, Interrupted

_P = ParamSpec("_P")
_R = TypeVar("_R")
_VALUE = r"('[^']*'|\"[^\"]*\"|[^\s,;`]+)"
_RULES: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], str]], ...] = (
    (
        re.compile(rf"--set ([\w.]+)={_VALUE}"),
        lambda found: f'**{{"{found[1]}": {_value(found[2])}}}',
    ),
    (re.compile(r"--set (?=[\w.]+)"), lambda found: ""),
    (re.compile(r"--set\b"), lambda found: "a keyword argument"),
    (re.compile(r"(?<= )--resume\b"), lambda found: "resume=True"),
    (re.compile(r"--out (/\S+|'[^']*')"), lambda found: f'out="{_bare(found[1])}"'),
    (
        re.compile(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)"),
        lambda found: found[1].replace("-", "_"),
    ),
)
_KEY = re.compile(r'\*\*\{"([\w.]+)": ("[^"]*"|\[[^\]]*\])\}')
_COMMAND = re.compile(r"(viform [a-z][^,;`]*)")


@overload
def in_python(function: Callable[_P, _R], /) -> Callable[_P, _R]: ...
@overload
def in_python(*, section: str) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]: ...
def in_python(
    function: Callable[_P, _R] | None = None, /, *, section: str = ""
) -> Callable[_P, _R] | Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Decorator of a function whose InputError and Interrupted speak of arguments. section: that
    whose keys are its arguments, without its name; "" for whole keys."""
    if function is None:
        return lambda function: _speaking(function, section)
    return _speaking(function, section)


def _speaking(function: Callable[_P, _R], section: str) -> Callable[_P, _R]:
    def words(text: str) -> str:
        text = python_words(text)
        return _in_section(text, section) if section else text

    @wraps(function)
    def called(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            return function(*args, **kwargs)
        except TypeError as exc:
            if exc.__traceback__ is not None and exc.__traceback__.tb_next is None:
                _check_given(function, args, kwargs)  # it was not entered
            raise
        except InputError as exc:
            # What was given is the user's own text.
            exc.what, exc.must, exc.remedy = map(words, (exc.what, exc.must, exc.remedy))
            exc.args = (exc.what, exc.must, exc.actual, exc.remedy, *exc.args[4:])
            raise
        except Interrupted as exc:
            exc.remedy = words(exc.remedy)
            exc.args = (exc.done, exc.total, exc.remedy, exc.unit)
            raise

    return called


def _check_given(
    function: Callable[..., object], args: tuple[Any, ...], keys: dict[str, Any]
) -> None:
    """Raises InputError if a call lacks arguments that have no default; what else is wrong with it
    is Python's to say."""
    known = signature(function)
    try:
        given = known.bind_partial(*args, **keys).arguments
    except TypeError:
        return
    lacking = [
        name
        for name, each in known.parameters.items()
        if name not in given
        and each.default is Parameter.empty
        and each.kind not in (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)
    ]
    if lacking:
        raise InputError(
            " and ".join(lacking), "given", "absent", f"write {lacking[0]}=..."
        ) from None


def python_words(text: str) -> str:
    """A text about options as one about arguments; a command in it stays."""
    parts = _COMMAND.split(text)
    for n in range(0, len(parts), 2):
        for pattern, replacement in _RULES:
            parts[n] = pattern.sub(replacement, parts[n])
    return "".join(parts)


def _in_section(text: str, section: str) -> str:
    """A text in `python_words` for an object that takes the keys of a section without its name."""

    def own(found: re.Match[str]) -> str:
        key, value = found[1].removeprefix(f"{section}."), found[2]
        if key == "scene.illuminance":
            key = "illuminance"
        return f"{key}={value}" if key.isidentifier() else f'**{{"{key}": {value}}}'

    return _KEY.sub(own, text)


def _value(given: str) -> str:
    """The value of an option as Python has it: a list, or a text."""
    bare = _bare(given)
    return bare if bare.startswith("[") else f'"{bare}"'


def _bare(value: str) -> str:
    return value.strip("'\"")
