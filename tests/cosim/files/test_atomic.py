"""Atomic writing of files."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from cosim import InputError
from cosim.files.atomic import atomic_write


def test_a_killed_process_leaves_no_part_for_long(tmp_path: Path) -> None:
    path = tmp_path / "a [1].mp4"
    kill = f"""
import os, pathlib, signal
from cosim.files.atomic import atomic_write
with atomic_write(pathlib.Path({str(path)!r})) as part:
    part.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run([sys.executable, "-c", kill], check=False)
    (part,) = tmp_path.iterdir()
    assert part.name.endswith(".part")
    alive = tmp_path / f".{path.name}.{os.getppid()}.part"  # another process's, which still writes
    other = tmp_path / f".other.{part.name.split('.')[-2]}.part"
    for file in (alive, other):
        file.touch()
    with atomic_write(path) as part:
        part.write_text("whole")
    assert sorted(tmp_path.iterdir()) == sorted([path, alive, other])


def test_a_full_disk_is_said_by_who_knows_what_then(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    with pytest.raises(OSError, match="No space left") as caught, atomic_write(path) as part:
        part.write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert caught.value.filename == str(path) and not list(tmp_path.iterdir())


def test_a_full_disk_is_an_error_of_the_file_in_a_clip_too(tmp_path: Path) -> None:
    """FFmpeg's error is an OSError whose file name cannot be set, and not one of the format."""
    import av

    with (
        pytest.raises(OSError, match="No space left") as found,
        atomic_write(tmp_path / "a.mp4") as part,
    ):
        raise av.error.OSError(errno.ENOSPC, "No space left on device", str(part))
    assert found.value.errno == errno.ENOSPC and "a.mp4" in found.value.filename
    assert not isinstance(found.value, av.FFmpegError)


def test_a_name_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    path = tmp_path / ("a" * 250)  # its temporary name is too long
    refused = pytest.raises(InputError, match="must be a name that can be written, not refused")
    with refused, atomic_write(path) as part:
        part.write_text("whole")
