"""Sums of the files of PoCL's cache, with programs and kernels that are written here."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from cosim.compute.pocl_files import PoclFiles, drop_damaged

SECOND = 10**9


class Process:
    """A process that builds programs in the cache and launches their kernels, as PoCL does."""

    def __init__(self, cache: Path, own: bool = True) -> None:
        self._cache = cache
        self.files = PoclFiles(cache, own)

    def build(self, key: str, folder: str, meanwhile: Callable[[], object] = lambda: None) -> bool:
        """Whether the program had to be compiled. meanwhile: what another process does."""
        place = self._cache / folder
        with self.files.building(key):
            compiled = not (place / "program.bc").exists()
            place.mkdir(parents=True, exist_ok=True)
            if compiled:
                (place / "program.bc").write_bytes(b"program")
            meanwhile()
            accessed = place / "last_accessed"
            accessed.touch()
            os.utime(accessed, ns=(0, accessed.stat().st_mtime_ns + SECOND))
        return compiled

    def launch(self, folder: str) -> bool:
        """Whether the kernel had to be compiled."""
        path = self._cache / folder / "kernel/8-1-1/kernel.so"
        if path.exists():
            assert path.read_bytes() == b"kernel", "PoCL would end the process"
            return False
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"kernel")
        return True

    def end(self, killed: bool = False) -> None:
        if not killed:
            self.files.keep()
        os.close(self.files._users)


def run(cache: Path, killed: bool = False, own: bool = True) -> list[bool]:
    """Whether program and kernel were compiled by a process that starts and ends."""
    process = Process(cache, own)
    compiled = [process.build("one", "AB/CD"), process.launch("AB/CD")]
    process.end(killed)
    return compiled


@pytest.mark.parametrize("name", ["program.bc", "kernel/8-1-1/kernel.so"])
@pytest.mark.parametrize(
    "damage", [lambda data: b"", lambda data: data[:3], lambda data: bytes(len(data))]
)
def test_a_damaged_file_is_dropped_and_said(
    name: str, damage: Callable[[bytes], bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert [run(tmp_path), run(tmp_path)] == [[True, True], [False, False]]
    path = tmp_path / "AB/CD" / name
    path.write_bytes(damage(path.read_bytes()))
    assert capsys.readouterr().err == ""
    assert run(tmp_path) == [True, True]
    assert capsys.readouterr().err == (
        f"viform: files of the cache {tmp_path} were damaged (1); they are dropped and compiled "
        "again\n"
    )
    assert run(tmp_path) == [False, False]


def test_files_without_a_sum_are_dropped_where_nobody_else_uses_the_cache(tmp_path: Path) -> None:
    stranger = tmp_path / "EF/GH/program.bc"
    stranger.parent.mkdir(parents=True)
    stranger.write_bytes(b"cut")
    (stranger.parent / "last_accessed").touch()
    run(tmp_path, own=False)
    assert stranger.exists()
    for path in (tmp_path / "sums").glob("[!.]*"):
        path.write_text('{"folder": "AB/')  # damaged itself
    other = Process(tmp_path)
    run(tmp_path)
    assert stranger.exists()
    other.end()
    for path in (tmp_path / "sums").glob("[!.]*"):
        path.unlink()
    assert run(tmp_path, killed=True) == [True, True] and not stranger.exists()
    # Of the process that was killed, the program has a sum, and the kernel has none.
    process = Process(tmp_path)
    assert [process.build("one", "AB/CD"), process.launch("AB/CD")] == [False, True]
    process.files.keep()
    process.end(killed=True)
    assert run(tmp_path, killed=True) == [False, False]


def test_a_kernel_that_another_process_has_just_compiled_stays(tmp_path: Path) -> None:
    first = Process(tmp_path)
    assert first.build("one", "AB/CD") and first.launch("AB/CD")
    second = Process(tmp_path)
    assert not second.build("one", "AB/CD") and not second.launch("AB/CD")
    first.end(killed=True)
    second.end()
    assert run(tmp_path) == [False, False]


def test_a_program_that_is_built_while_another_process_builds_has_sums(tmp_path: Path) -> None:
    run(tmp_path)
    first, second = Process(tmp_path), Process(tmp_path)
    assert first.build("two", "EF/GH", lambda: second.build("one", "AB/CD"))
    assert first.launch("EF/GH")
    first.end()
    second.end()
    sums = [json.loads(path.read_text()) for path in (tmp_path / "sums").glob("[!.]*")]
    assert {each["folder"]: len(each["files"]) for each in sums} == {"AB/CD": 2, "EF/GH": 2}


def test_a_program_that_is_lost_or_in_another_folder_is_compiled_again(tmp_path: Path) -> None:
    run(tmp_path)
    (tmp_path / "AB/CD/program.bc").unlink()
    (tmp_path / "AB/CD/kernel/8-1-1/kernel.so").unlink()
    assert run(tmp_path) == [True, True]
    os.utime(tmp_path / "AB/CD/last_accessed", (0, 0))
    process = Process(tmp_path)
    assert process.build("one", "EF/GH")
    process.end()
    process = Process(tmp_path)
    process.build("one", "EF/GH")
    process.end()
    (sums,) = (tmp_path / "sums").glob("[!.]*")
    assert json.loads(sums.read_text())["folder"] == "EF/GH"


def test_two_sources_may_have_one_folder(tmp_path: Path) -> None:
    run(tmp_path)
    other = Process(tmp_path)
    other.build("other", "AB/CD")  # its first build: what is there has a name
    other.end()
    path = tmp_path / "AB/CD/second/8-1-1/second.so"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"kernel")
    other.files.keep()
    assert run(tmp_path) == [False, False] and path.exists()
    path.write_bytes(b"")
    assert run(tmp_path) == [True, True] and not path.exists()
    assert len(list((tmp_path / "sums").glob("[!.]*"))) == 1


def test_all_damaged_files_are_found_at_once(tmp_path: Path) -> None:
    process = Process(tmp_path)
    for n in range(3):
        process.build(f"key{n}", f"AB/{n}")
        process.launch(f"AB/{n}")
    process.end()
    assert drop_damaged(tmp_path) == 0
    for name in ("AB/0/program.bc", "AB/1/program.bc", "AB/1/kernel/8-1-1/kernel.so"):
        (tmp_path / name).write_bytes(b"")
    assert drop_damaged(tmp_path) == 3
    assert drop_damaged(tmp_path) == 0
    process = Process(tmp_path)
    assert [process.build(f"key{n}", f"AB/{n}") for n in range(3)] == [True, True, False]
    process.end()
