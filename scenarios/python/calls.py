"""What the objects of Python have in common, which are set up once and called again and again:
their end, the numbers of their calls, their keys, and results in order from several threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from threading import Lock
from typing import Any, Final, Self

from cosim import InputError
from cosim.compute.cores import cores
from cosim.compute.stopping import threads
from cosim.errors import quote
from scenarios.python.frames import is_whole

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
    section, as errors and the list of keys write it, or be a section, with a dictionary. One that
    is None is not given."""
    whole = (section, *others)
    known = tuple(f"{name}." for name in whole)
    return {
        key if key.startswith(known) or key in whole else f"{section}.{key}": keys[key]
        for key in keys
        if keys[key] is not None
    }


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
