"""OpenCL: choice of a device, messages without one, compilation once, writable caches."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import cosim
from cosim import InputError
from cosim.compute.cache_folder import cache_folder, prepare_caches
from cosim.compute.opencl import INSTALL, Device, open_device, probe
from cosim.errors import shorten

SOURCE = """
kernel void add(global int *x) { x[get_global_id(0)] += STEP; }
kernel void multiply(global int *x) { x[get_global_id(0)] *= STEP; }
"""


@pytest.fixture
def homeless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No variable sets a cache; temporary files are below the returned folder."""
    caches = ("VIFORM_CACHE", "POCL_CACHE_DIR", "MPLCONFIGDIR", "NUMBA_CACHE_DIR")
    for name in (*caches, "XDG_CACHE_HOME", "HOME"):
        monkeypatch.setenv(name, "")  # so that monkeypatch restores it, whatever happens meanwhile
        monkeypatch.delenv(name)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr("cosim.compute.cache_folder._SAID", set())
    return tmp_path


def test_a_device_is_found_by_any_part_of_its_name(device: Device) -> None:
    platform, _, name = device.name.partition(": ")
    assert open_device(platform.upper()).name.startswith(platform)
    assert open_device(name.lower()[-8:]).name.endswith(name[-8:])


def test_devices_of_one_name_are_told_apart_by_number(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    cl = pytest.importorskip("pyopencl")
    platform = device.handle.platform
    again = SimpleNamespace(name=platform.name, get_devices=lambda: [device.handle] * 2)
    monkeypatch.setattr(cl, "get_platforms", lambda: [again])
    assert [open_device(n).number for n in ("0", "1", device.name[-5:])] == [0, 1, 0]
    with pytest.raises(InputError, match=f"a name of: 0: {device.name[:8]}.*; 1: .*; or numba"):
        open_device("2000")


def test_a_device_named_wrongly_is_one_line_that_names_the_right_ones(device: Device) -> None:
    with pytest.raises(InputError) as refused:
        open_device("abacus")
    text = str(refused.value)
    assert text.startswith("the OpenCL device must be one that this machine has, not 'abacus'; ")
    assert device.name in text
    assert "numba" in text
    assert "\n" not in text


@pytest.mark.parametrize("how", ["empty", "error"])
def test_no_device_is_one_line_with_what_to_install(
    monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    cl = pytest.importorskip("pyopencl")

    def none() -> list[object]:
        if how == "error":
            raise cl.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")
        return []

    monkeypatch.setattr(cl, "get_platforms", none)
    with pytest.raises(InputError) as refused:
        open_device()
    assert str(refused.value) == (
        "the OpenCL device must be one that this machine has, not none at all; "
        f"install one ({INSTALL}) or pass --device numba"
    )


def test_without_sys_nothing_is_opened_that_would_abort(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.compute.opencl._PROBE", "import os; os.abort()")
    monkeypatch.setattr(os.path, "isdir", lambda path: False)
    with pytest.raises(InputError, match="/sys is not mounted"):
        open_device()


@pytest.mark.parametrize(
    "child",
    [
        "import os; os.abort()",
        "import sys; sys.exit(3)",
        "raise ImportError('libOpenCL.so.1')",
        "print('[{')",
        "",
    ],
)
def test_probe_finds_nothing_when_the_child_dies(
    monkeypatch: pytest.MonkeyPatch, child: str
) -> None:
    monkeypatch.setattr("cosim.compute.opencl._PROBE", child)
    assert probe() == []


def test_probe_finds_nothing_when_the_child_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    def hang(command: list[str], timeout: float, **_: object) -> None:
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(subprocess, "run", hang)
    assert probe() == []


def test_probe_tells_what_the_child_found(device: Device) -> None:
    found = probe()
    assert device.name in [f"{d['platform']}: {d['device']}" for d in found]
    assert all(d["units"] >= 1 and d["version"].startswith("OpenCL") for d in found)


def test_a_program_is_compiled_once_for_each_source_and_options(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyopencl as cl

    built: list[str] = []
    program = cl.Program

    def counted(context: object, source: str) -> object:
        built.append(source)
        return program(context, source)

    monkeypatch.setattr(cl, "Program", counted)
    fresh = Device(device.handle, device.name)
    values = np.arange(5, dtype=np.int32)
    buffer = fresh.upload(values)
    for name, step in (("add", 3), ("multiply", 3), ("add", 3), ("add", 10)):
        fresh.kernel(SOURCE, name, (f"-DSTEP={step}",))(fresh.queue, (5,), None, buffer)
    assert built == [SOURCE, SOURCE]
    fresh.kernel(SOURCE + "\n", "add", ("-DSTEP=3",))
    assert len(built) == 3
    fresh.finish()
    out = fresh.download(buffer, np.empty_like(values))
    np.testing.assert_array_equal(out, (values + 3) * 3 + 3 + 10)


NUMBERS = """
kernel void numbers(global double *out, const uint a, const int b, const float c, const uchar d,
                    const ulong e, constant int *f) {
    out[0] = a; out[1] = b; out[2] = c; out[3] = d; out[4] = e; out[5] = f[0];
}
"""


def test_numbers_have_the_types_of_the_kernel(device: Device) -> None:
    out = device.upload(np.zeros(6))
    last = device.upload(np.array([-7], np.int32))
    # Wider types than those of the kernel: undeclared, they would be refused or misread.
    numbers = (np.int64(2**32 - 1), np.int64(-5), np.float64(0.1), np.int64(255), np.int64(2**40))
    device.kernel(NUMBERS, "numbers")(device.queue, (1,), None, out, *numbers, last)
    values = np.empty(6)
    fetched = device.fetch(out, values)
    device.finish()
    del fetched
    assert values.tolist() == [2**32 - 1, -5, float(np.float32(0.1)), 255, 2**40, -7]


def test_kernels_are_untyped_where_the_driver_tells_no_types(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyopencl as cl

    def silent(*_: object) -> None:
        raise cl.RuntimeError("clGetKernelArgInfo", cl.status_code.INVALID_OPERATION, "no types")

    monkeypatch.setattr(cl.Kernel, "get_arg_info", silent)
    out = device.upload(np.zeros(6))
    last = device.upload(np.array([-7], np.int32))
    numbers = (np.uint32(1), np.int32(-5), np.float32(0.1), np.uint8(2), np.uint64(2**40))
    device.kernel(NUMBERS, "numbers")(device.queue, (1,), None, out, *numbers, last)
    values = device.download(out, np.empty(6))
    assert values.tolist() == [1, -5, float(np.float32(0.1)), 2, 2**40, -7]


_NOISY = """
from cosim.compute.opencl import open_device
source = "kernel void f(global int *x) { int unused; double y = x[0]; x[1] = sin(y); }"
open_device().kernel("#warning read me\\n" + source, "f")
"""
"""Compiles in its own process: clang writes to the standard error of the process."""


def test_warnings_of_the_compiler_are_shown_on_request_alone(
    device: Device, tmp_path: Path
) -> None:
    own = ("POCL_CACHE_DIR", "PYOPENCL_COMPILER_OUTPUT")
    clean = {name: value for name, value in os.environ.items() if name not in own}
    said = []
    for asked in ({}, {"PYOPENCL_COMPILER_OUTPUT": "1"}):
        environment = clean | {"VIFORM_CACHE": str(tmp_path / f"cache{len(asked)}")} | asked
        command = [sys.executable, "-c", _NOISY]
        child = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert child.returncode == 0, child.stderr
        said.append(child.stderr)
    assert said[0] == ""
    assert "read me" in said[1]


def test_the_cache_is_the_first_folder_that_can_be_written(
    homeless: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fallback = homeless / f"viform-{os.getuid()}"
    assert cache_folder() == fallback
    assert fallback.is_dir()
    for name, folder in (
        ("HOME", homeless / "home/.cache/viform"),
        ("XDG_CACHE_HOME", homeless / "xdg/viform"),
        ("VIFORM_CACHE", homeless / "mine"),
    ):
        top = folder.relative_to(homeless).parts[0]
        monkeypatch.setenv(name, str(homeless / top))
        assert cache_folder() == folder
        assert folder.is_dir()


def test_a_cache_that_cannot_be_written_is_said(
    homeless: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (homeless / "file").touch()  # no folder can be made below a file, not even by root
    monkeypatch.setenv("HOME", str(homeless / "file"))
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("VIFORM_CACHE", str(homeless / "file"))
    for _ in range(2):  # said once
        assert cache_folder() == homeless / f"viform-{os.getuid()}"
    assert capsys.readouterr().err == (
        "viform: VIFORM_CACHE must be a folder of this user that nobody else may enter (mode 700), "
        f"not {shorten(str(homeless / 'file'))} (no folder); "
        f"{homeless / f'viform-{os.getuid()}'} is used\n"
    )
    # The temporary one is taken only when it is the user's own.
    other = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: other)
    (homeless / f"viform-{other}").mkdir()
    found = cache_folder()
    assert found.parent == homeless
    assert found.name not in ("file", f"viform-{other}", f"viform-{other - 1}")
    assert found.is_dir()


@pytest.mark.parametrize("kind", ["link", 0o777, 0o750])
def test_a_temporary_cache_that_others_may_change_is_not_used(
    homeless: Path, kind: int | str
) -> None:
    shared = homeless / f"viform-{os.getuid()}"
    if kind == "link":
        (homeless / "elsewhere").mkdir(mode=0o700)
        shared.symlink_to(homeless / "elsewhere")
    else:
        shared.mkdir()
        shared.chmod(int(kind))
    found = cache_folder()
    assert found != shared and found.parent == homeless
    assert found.stat().st_mode & 0o777 == 0o700 and not found.is_symlink()


@pytest.mark.parametrize("kind", ["a link", "mode 777", "mode 755", "of user 7", "not writable"])
def test_a_foreign_cache_is_said_and_not_used(
    homeless: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    mine = homeless / "mine"
    (homeless / "elsewhere").mkdir(mode=0o700)
    if kind == "a link":
        mine.symlink_to(homeless / "elsewhere")
    else:
        mine.mkdir(mode=0o700)
    if kind.startswith("mode"):
        mine.chmod(int(kind[-3:], 8))
    if kind == "of user 7":
        status = list(mine.stat())
        status[4] = 7
        lstat = Path.lstat
        other = os.stat_result(status)
        monkeypatch.setattr(Path, "lstat", lambda path: other if path == mine else lstat(path))
    if kind == "not writable":
        monkeypatch.setattr(os, "access", lambda path, _: Path(path) != mine)
    monkeypatch.setenv("VIFORM_CACHE", str(mine))
    monkeypatch.setenv("XDG_CACHE_HOME", str(homeless / "xdg"))
    prepare_caches()
    assert os.environ["VIFORM_CACHE"] == str(homeless / "xdg/viform")
    assert cache_folder() == homeless / "xdg/viform"
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("viform: VIFORM_CACHE must be a folder of this user")
    said = shorten(str(mine))
    assert f"not {said} ({kind}); {homeless / 'xdg/viform'} is used" in line
    assert not list((homeless / "elsewhere").iterdir())


def test_a_full_disk_of_the_cache_is_said(homeless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiler writes its stages there, and ends the process where it cannot."""
    monkeypatch.setenv("VIFORM_CACHE", str(homeless / "mine"))
    full = SimpleNamespace(total=1 << 40, free=31 << 20)
    monkeypatch.setattr("cosim.compute.opencl.shutil.disk_usage", lambda _: full)
    with pytest.raises(InputError) as refused:
        open_device()
    assert str(refused.value) == (
        "the cache of compiled kernels must be on a disk with 32 MiB of room, not "
        f"{homeless / 'mine/pocl'} (31 MiB free); make room, or set VIFORM_CACHE to another folder"
    )


def test_the_user_s_cache_is_closed_to_others(
    homeless: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = homeless / ".cache/viform"
    folder.mkdir(parents=True)
    folder.chmod(0o755)
    monkeypatch.setenv("HOME", str(homeless))
    assert cache_folder() == folder and folder.stat().st_mode & 0o777 == 0o700


def test_the_cache_stays_where_it_is_once_found(
    homeless: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(homeless))
    child = "import os, json; print(json.dumps([dict(os.environ)]))"
    monkeypatch.setattr("cosim.compute.opencl._PROBE", child)
    folder = homeless / ".cache/viform"
    for _ in range(2):
        (variables,) = probe()
        assert variables["POCL_CACHE_DIR"] == str(folder / "pocl")
        assert "MPLCONFIGDIR" not in variables  # from Python, a user's own settings stay
        assert cache_folder() == folder
    assert (folder / "pocl").is_dir()
    assert not (folder / "viform").exists()


def test_numba_keeps_what_it_compiled_beside_the_code_only_where_that_can_be_written(
    homeless: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = Path(cosim.__file__).parent / "compute"
    for writable in (True, False):
        monkeypatch.setattr(os, "access", lambda path, _, yes=writable: path != code or yes)
        prepare_caches()
        assert ("NUMBA_CACHE_DIR" in os.environ) is not writable
    assert os.environ["NUMBA_CACHE_DIR"] == str(homeless / f"viform-{os.getuid()}/numba")
