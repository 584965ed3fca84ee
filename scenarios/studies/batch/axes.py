"""Keys that vary between the runs of a batch, their values, and the points that they span."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from cosim import InputError

MOST: Final = 100_000
"""Largest number of points."""
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_FORM = "KEY=a,b,c or KEY=lo:hi:n or KEY=lo:hi:nlog"


@dataclass(frozen=True)
class Axis:
    """A key and its values.

    Attributes:
        key: key of the scenario.
        texts: values as text with their unit; () for a range of which points are drawn.
        span: lowest and highest number; None for a list of texts.
        unit: unit of the numbers.
        log: whether the logarithm is evenly spaced.
        whole: whether a drawn value is a whole number.
        given: the text that it was read from.
    """

    key: str
    texts: tuple[str, ...]
    span: tuple[float, float] | None = None
    unit: str = ""
    log: bool = False
    whole: bool = False
    given: str = ""

    def at(self, share: float) -> str:
        """The value at a share of the range, 0 to 1."""
        assert self.span is not None
        low, high = self.span
        if self.whole:
            return _text(min(low + (high - low + 1) * share // 1, high), self.unit)
        value = low * (high / low) ** share if self.log else low + (high - low) * share
        return _text(value, self.unit)

    @property
    def numbers(self) -> list[float] | None:
        """The values without their unit; None if they are not numbers of one unit."""
        read = [_NUMBER.fullmatch(text) for text in self.texts]
        if not all(read) or len({match[2] for match in read if match}) != 1:
            return None
        return [float(match[1]) for match in read if match]


def _text(value: float, unit: str) -> str:
    number = f"{value:.12g}"
    return f"{number} {unit}" if unit else number


def read_axis(text: str) -> Axis:
    """Reads "KEY=a,b,c" (values, of which a list is JSON), "KEY=lo:hi:n" (n numbers, evenly
    spaced), "KEY=lo:hi:nlog" (their logarithms evenly spaced), or "KEY=lo:hi", "KEY=lo:hi:log" and
    "KEY=lo:hi:int" (a range of which points are drawn, the last of whole numbers).

    Raises:
        InputError: the text has another form.
    """
    key, equals, values = text.partition("=")
    key = key.strip()
    if not equals or not key or not values.strip():
        raise InputError("--vary", _FORM, repr(text), "write it in this form")
    found = _range(key, values.split(":"))
    if found is not None:
        return replace(found, given=text)
    texts = tuple(value.strip() for value in _values(values))
    if not all(texts) or len(set(texts)) != len(texts):
        raise InputError(f"--vary {key}", "different values", repr(values), "leave one out")
    return Axis(key, texts, given=text)


def _values(text: str) -> list[str]:
    """The text between commas that are not within a list, which is JSON as in --set."""
    parts, depth, quoted, before = [""], 0, False, ""
    for sign in text:
        if depth and sign == '"' and before != "\\":
            quoted = not quoted
        if not quoted:
            depth += (sign in "[{") - (sign in "]}")
        if sign == "," and depth <= 0:
            parts.append("")
        else:
            parts[-1] += sign
        before = sign
    return parts


def _range(key: str, parts: list[str]) -> Axis | None:
    """A range; None if the parts are none."""
    ends = [_NUMBER.fullmatch(part) for part in parts[:2]]
    if len(parts) not in (2, 3) or len(ends) != 2 or ends[0] is None or ends[1] is None:
        return None
    low, high = float(ends[0][1]), float(ends[1][1])
    unit = ends[1][2]
    end = re.fullmatch(r"\s*(?:(int)|(\d*)\s*(log)?)\s*", parts[2] if len(parts) == 3 else "")
    if end is None:
        raise InputError(f"--vary {key}", _FORM, repr(parts[2]), "end it with a number of values")
    whole, number, log = end[1] is not None, end[2], end[3] is not None
    if ends[0][2] not in ("", unit):
        raise InputError(
            f"--vary {key}", "a range in one unit", f"{parts[0]}:{parts[1]}", "use one unit"
        )
    if not low < high or (log and low <= 0):
        least = "above 0, and " if log else ""
        raise InputError(
            f"--vary {key}", f"{least}from a lower to a higher number", f"{parts[0]}:{parts[1]}",
            f"write {':'.join([parts[1], parts[0], *parts[2:]])}"
            if low > high and (high > 0 or not log)
            else "raise the lower one" if low < high else "write two that differ",
        )  # fmt: skip
    if whole and (low % 1 or high % 1):
        raise InputError(
            f"--vary {key}", "from a whole number to another", f"{parts[0]}:{parts[1]}",
            "round both",
        )  # fmt: skip
    if not number:
        return Axis(key, (), (low, high), unit, log, whole)
    if not 2 <= int(number) <= MOST:
        raise InputError(
            f"--vary {key}", f"2 to {MOST} values", number, "write 2 or more, such as 5"
        )
    space = np.geomspace if log else np.linspace
    texts = tuple(_text(float(value), unit) for value in space(low, high, int(number)))
    return Axis(key, texts, (low, high), unit, log)


def check_axes(axes: Sequence[Axis], assignments: Sequence[str]) -> None:
    """Raises InputError for a key that varies twice, or is also that of an assignment of --set."""
    keys = [axis.key for axis in axes]
    for key in keys:
        if keys.count(key) > 1:
            raise InputError("--vary", "a key once", f"{key} twice", "leave one out")
        if any(text.partition("=")[0].strip() == key for text in assignments):
            raise InputError("--set", "a key that does not vary", key, "leave it out")


def grid(axes: Sequence[Axis]) -> list[tuple[str, ...]]:
    """All combinations of the values, the last axis fastest.

    Raises:
        InputError: a range without a number of values, or too many combinations.
    """
    for axis in axes:
        if not axis.texts:
            raise InputError(
                f"--vary {axis.key}", "given with a number of values, or --samples", "neither",
                f"add one, such as {axis.at(0)}:{axis.at(1)}:5",
            )  # fmt: skip
    count = int(np.prod([len(axis.texts) for axis in axes], dtype=np.float64))
    if count > MOST:
        raise InputError("--vary", f"at most {MOST} combinations", f"{count}", "use --samples")
    return list(itertools.product(*(axis.texts for axis in axes)))


def latin_hypercube(axes: Sequence[Axis], samples: int, seed: int) -> list[tuple[str, ...]]:
    """Points of which each range has one in each of `samples` equal parts (McKay et al.,
    Technometrics 21:239, 1979). A list of values takes them in turn, in random order.

    Raises:
        InputError: the number of samples.
    """
    if not 1 <= samples <= MOST:
        raise InputError(
            "--samples", f"1 to {MOST}", f"{samples}", f"write {1 if samples < 1 else MOST}"
        )
    random = np.random.Generator(np.random.Philox(key=seed))
    columns = []
    for axis in axes:
        order = random.permutation(samples)
        within = random.random(samples)
        if axis.span is None:
            columns.append([axis.texts[n % len(axis.texts)] for n in order])
        else:
            columns.append([axis.at((n + x) / samples) for n, x in zip(order, within, strict=True)])
    return list(zip(*columns, strict=True))
