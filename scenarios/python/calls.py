"""What the functions and the objects of Python have in common: texts of errors for someone who
calls them, and objects that are set up once and called again and again.

The parts name what a user can mend by the options of the commands. In errors of Python,
`--set a.b=c` becomes `**{"a.b": "c"}`, and `--option value` an argument of that name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from itertools import islice
from threading import Lock
from typing import Any, Final, ParamSpec, Self, TypeVar, overload

from cosim import InputError, Interrupted
from cosim.compute.cores import cores
from cosim.compute.stopping import threads
from cosim.errors import quote
from scenarios.python.frames import is_whole

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


def _value(given: str) -> str:
    """The value of an option as Python has it: a list, or a text."""
    bare = _bare(given)
    return bare if bare.startswith("[") else f'"{bare}"'


def _bare(value: str) -> str:
    return value.strip("'\"")


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


_AHEAD: Final = 2
"""Results that `in_order` has, or is making, before they are asked for, for each core."""


class Called:
    """An object that is called until it is closed, and a context manager. Its `_core`, once it is
    made, has `forget`."""

    _core: Any

    def __init__(self) -> None:
        self._lock, self._calls, self._closed = Lock(), 0, False

    def close(self) -> None:
        """Ends its use; later calls are refused."""
        self._closed = True
        core = self.__dict__.get("_core")  # a camera's is made at its first call
        if core is not None:
            core.forget()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    @property
    def _state(self) -> str:
        """The end of its text."""
        return ", closed" if self._closed else ""

    def _check_open(self) -> None:
        """Raises InputError if it is closed."""
        if self._closed:
            name = type(self).__name__
            raise InputError(f"the {name.lower()}", "open", "closed", f"make another {name}")

    def _number(self, call: int | None, name: str = "call") -> int:
        """The number of a call: the next one, or a given one, by the name of its argument. Raises
        InputError."""
        self._check_open()
        if call is not None:
            if not is_whole(call) or not 0 <= call < 2**64:
                raise InputError(name, "a whole number from 0", quote(call), "change it")
            return int(call)
        with self._lock:
            self._calls += 1
            return self._calls - 1


def keys_of(section: str, keys: Mapping[str, Any], *others: str) -> dict[str, Any]:
    """The keys of a scenario, of those of a section and of others. A key may have the name of its
    section, as errors and the list of keys write it."""
    known = tuple(f"{name}." for name in (section, *others))
    return {key if key.startswith(known) else f"{section}.{key}": keys[key] for key in keys}


def in_order(call: Callable[[int, Any], Any], items: Iterable[Any], begin: int) -> Iterator[Any]:
    """The results of `call(number, item)` in the order of the items, numbered from `begin`, by a
    thread for each core; a few of them are made ahead."""
    count = cores()
    with threads(count) as pool:
        rest = enumerate(items, begin)
        ahead = islice(rest, _AHEAD * count)
        waiting = [pool.submit(call, number, item) for number, item in ahead]
        try:
            while waiting:
                done = waiting.pop(0).result()
                waiting += [pool.submit(call, number, item) for number, item in islice(rest, 1)]
                yield done
        finally:
            for each in waiting:
                each.cancel()
