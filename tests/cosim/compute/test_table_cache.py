"""Tables that are kept between runs."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cosim.compute import table_cache as module
from cosim.compute.table_cache import cached_table, described, sources_of


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VIFORM_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "tables"


class Maker:
    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> np.ndarray:
        self.calls += 1
        return np.arange(6.0).reshape(2, 3) + self.calls


def test_a_table_is_made_once(tmp_path: Path) -> None:
    make, source = Maker(), tmp_path / "source.py"
    source.write_text("one")
    first = cached_table("law", (1.0, b"x"), (str(source),), make)
    again = cached_table("law", (1.0, b"x"), (str(source),), make)
    assert make.calls == 1
    assert (first == again).all() and again.dtype == first.dtype and again.shape == (2, 3)


def test_other_arguments_or_sources_make_another(tmp_path: Path) -> None:
    make, source = Maker(), tmp_path / "source.py"
    source.write_text("one")
    cached_table("law", (1.0,), (str(source),), make)
    cached_table("law", (2.0,), (str(source),), make)
    source.write_text("two")
    cached_table("law", (1.0,), (str(source),), make)
    assert make.calls == 3


@pytest.mark.parametrize("damage", [b"", b"short", None])
def test_a_damaged_file_is_made_again(folder: Path, damage: bytes | None) -> None:
    make = Maker()
    cached_table("law", (1.0,), (), make)
    (path,) = folder.iterdir()
    data = bytearray(path.read_bytes())
    data[-3] ^= 1
    path.write_bytes(data if damage is None else damage)
    got = cached_table("law", (1.0,), (), make)
    assert make.calls == 2 and got[0, 0] == 2.0
    assert (cached_table("law", (1.0,), (), make) == got).all() and make.calls == 2


def test_a_folder_that_refuses_gives_the_table_all_the_same(folder: Path) -> None:
    folder.parent.mkdir()
    folder.write_text("a file in place of the folder")
    assert cached_table("law", (1.0,), (), Maker())[0, 0] == 1.0


def test_old_files_are_removed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MOST", 3)
    make = Maker()
    for n in range(6):
        cached_table("law", (n,), (), make)
    assert len(list(folder.iterdir())) == 3
    cached_table("law", (5,), (), make)
    assert make.calls == 6


def test_a_description_tells_apart_all_that_may_differ() -> None:
    @dataclass(frozen=True)
    class Part:
        values: np.ndarray
        names: frozenset[str]
        rate: Fraction = Fraction(1, 3)

    ramp = np.arange(2000.0)
    one = {"part": Part(ramp, frozenset("ab")), "tau": (1, 1.0, None, b"1", "1", True)}
    same = {"tau": (1, 1.0, None, b"1", "1", True), "part": Part(ramp.copy(), frozenset("ba"))}
    assert described(one) == described(same)
    other = ramp.copy()
    other[1000] += 1e-12  # within what the text of an array leaves out
    for changed in (
        {"part": Part(other, frozenset("ab")), "tau": one["tau"]},
        {"part": Part(ramp, frozenset("a")), "tau": one["tau"]},
        {"part": Part(ramp, frozenset("ab"), Fraction(1, 4)), "tau": one["tau"]},
        {"part": one["part"], "tau": (1.0, 1, None, b"1", "1", True)},
    ):
        assert described(changed) != described(one)

    class Slotted:
        __slots__ = ("gain",)

    for alike in (object(), len, lambda: 1, partial(max, 1), Slotted(), np.array([one])):
        with pytest.raises(TypeError, match="described by its content"):
            described([alike])


def test_sources_are_those_of_all_folders_of_a_package() -> None:
    found = sources_of("cosim")
    assert module.__file__ in found and any(path.endswith("philox.cl") for path in found)
