"""OpenCL: choice of a device, compilation, and transfer of arrays. The only file that imports it.

PoCL runs the kernels on any processor. It has three peculiarities: it finds no device if its cache
folder is not writable, and it aborts the process if /sys is missing or a file of its cache is
damaged (`pocl_files`).
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import warnings
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.compiling import compiles
from cosim.compute.forks import lose_in_forks, use
from cosim.compute.kernels import SharedKernel
from cosim.compute.pocl_files import pocl_files
from cosim.errors import InputError, MissingPackages, shorten

__all__ = [
    "INSTALL",
    "Device",
    "cache_folder",
    "choose_device",
    "open_device",
    "opencl_packages",
    "prepare_caches",
    "probe",
    "wide_cl",
]

_PACKAGES = ("pocl-opencl-icd", "ocl-icd-libopencl1")
"""Debian packages that provide the processor as an OpenCL device."""
INSTALL = f"apt-get install {' '.join(_PACKAGES)}"

_KERNELS = 32 << 20
"""Bytes that the compiler may write for a run: some tens of kernels, each with its stages."""
_SAID: set[str] = set()
"""Values of VIFORM_CACHE that a line has said are not used."""
_LOCAL_GPU = 64
"""Work-items of a work-group on a GPU; 32 and 128 differ by 1 %."""
_PROBE = """
import json, pyopencl as cl
print(json.dumps([
    {"platform": p.name.strip(), "device": d.name.strip(), "version": d.version.strip(),
     "units": d.max_compute_units}
    for p in cl.get_platforms() for d in p.get_devices()]))
"""


def cache_folder() -> Path:
    """A writable folder for compiled kernels: VIFORM_CACHE, the user's cache, or a temporary
    folder.

    Compiled kernels are executed. So VIFORM_CACHE and the temporary folder are used only if they
    are folders, not links to one, that this user owns and nobody else may enter; a line on standard
    error says why VIFORM_CACHE is not used. The user's cache is made so. The temporary folder has
    the user's number in its name, so that runs share it.
    """
    choices = (("XDG_CACHE_HOME", "viform"), ("HOME", ".cache/viform"))
    caches = [Path(os.environ[name]) / below for name, below in choices if os.environ.get(name)]
    shared = Path(tempfile.gettempdir()) / f"viform-{os.getuid()}"
    given = os.environ.get("VIFORM_CACHE")
    why, found = "", None
    if given:
        why = _objection(Path(given))
        found = Path(given) if not why else None
    if found is None:
        own = (folder for folder in caches if not _objection(folder, close=True))
        found = next(own, None) or (shared if not _objection(shared) else None)
    found = found or Path(tempfile.mkdtemp(prefix="viform-"))
    if given and why and given not in _SAID:
        _SAID.add(given)
        print(
            f"viform: VIFORM_CACHE must be a folder of this user that nobody else may enter (mode "
            f"700), not {shorten(given)} ({why}); {found} is used",
            file=sys.stderr,
        )
    return found


def _objection(folder: Path, close: bool = False) -> str:
    """Why a folder must not hold programs, "" if it may; it is made if it is not there.

    close: whether to take the permissions of others away, and to follow links to folders.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.stat() if close else folder.lstat()
        if stat.S_ISLNK(found.st_mode):
            return "a link"
        if not stat.S_ISDIR(found.st_mode):
            return "no folder"
        if found.st_uid != os.getuid():
            return f"of user {found.st_uid}"
        if found.st_mode & 0o077:
            if not close:
                return f"mode {found.st_mode & 0o777:03o}"
            folder.chmod(0o700)
    except OSError as exc:
        return exc.strerror or type(exc).__name__
    return "" if os.access(folder, os.W_OK | os.X_OK) else "not writable"


def prepare_caches() -> None:
    """Directs the caches of PoCL, pyopencl and Matplotlib to a writable folder, for this process
    and its children, and that of numba if the source folder is not writable. It must be called
    before numba and Matplotlib are imported.

    VIFORM_CACHE is set to the folder. Otherwise a second call would use a folder below it, because
    the first has changed XDG_CACHE_HOME.
    """
    folder = cache_folder()
    os.environ["VIFORM_CACHE"] = str(folder)
    os.environ.setdefault("POCL_CACHE_DIR", str(folder / "pocl"))
    os.environ.setdefault("XDG_CACHE_HOME", str(folder))
    os.environ.setdefault("MPLCONFIGDIR", str(folder / "matplotlib"))
    if not os.access(Path(__file__).parent, os.W_OK):
        os.environ.setdefault("NUMBA_CACHE_DIR", str(folder / "numba"))
    Path(os.environ["POCL_CACHE_DIR"]).mkdir(parents=True, exist_ok=True)


def probe() -> list[dict[str, Any]]:
    """The OpenCL devices of this machine, found by a child process, which may abort.

    Returns:
        A dictionary for each device: platform, device, version, units. Empty if there is none, or
        if the child aborted or did not end.
    """
    prepare_caches()
    command = [sys.executable, "-c", _PROBE]
    try:
        child = subprocess.run(command, capture_output=True, text=True, timeout=60)
        devices: list[dict[str, Any]] = json.loads(child.stdout)
    except (subprocess.TimeoutExpired, json.JSONDecodeError):
        return []
    return devices


def opencl_packages() -> tuple[str, ...]:
    """Debian packages that provide a device; none if the user has set the loader to other
    drivers."""
    elsewhere = os.environ.get("OCL_ICD_VENDORS") or os.environ.get("OCL_ICD_FILENAMES")
    return () if elsewhere else _PACKAGES


def _no_device(value: str, remedy: str) -> InputError:
    return InputError("the OpenCL device", "one that this machine has", value, remedy)


def _check_cache(folder: Path) -> None:
    """Raises InputError if the disk of the cache is full: the compiler, which works in files there,
    would end the process."""
    free = shutil.disk_usage(folder)
    if free.total and free.free < _KERNELS:
        raise InputError(
            "the cache of compiled kernels",
            f"on a disk with {_KERNELS >> 20} MiB of room",
            f"{folder} ({free.free >> 20} MiB free)",
            "make room, or set VIFORM_CACHE to another folder",
        )  # fmt: skip


def choose_device(wanted: str | None) -> Device | None:
    """The selected OpenCL device, or None for "numba", the compiled form on the processor."""
    return None if wanted is not None and wanted.lower() == "numba" else open_device(wanted)


def open_device(wanted: str | None = None) -> Device:
    """The device whose "platform: device" text contains `wanted` (in any case). Without `wanted`,
    the first GPU, or else the first device.

    Raises InputError if there is none, or a parent of this process has used one before it forked.
    """
    use("OpenCL")
    prepare_caches()
    _check_cache(Path(os.environ["POCL_CACHE_DIR"]))
    if not os.path.isdir("/sys/devices/system/cpu") and not probe():
        raise _no_device(
            "none (/sys is not mounted, which PoCL needs)", "mount /sys, or pass --device numba"
        )
    import pyopencl as cl

    try:
        present = [(p, d) for p in cl.get_platforms() for d in p.get_devices()]
    except cl.Error:  # the loader reports "no platform" as an error
        present = []
    if not present:
        raise MissingPackages(
            "the OpenCL device", "one that this machine has", "none at all",
            f"install one ({INSTALL}) or pass --device numba", opencl_packages(),
        )  # fmt: skip
    names = [f"{p.name.strip()}: {d.name.strip()}" for p, d in present]
    if wanted is not None:
        hits = [i for i, name in enumerate(names) if wanted.lower() in name.lower()]
        if not hits:
            raise _no_device(repr(wanted), f"choose one of: {'; '.join(names)}; or numba")
        chosen = hits[0]
    else:
        gpus = [i for i, (_, d) in enumerate(present) if d.type & cl.device_type.GPU]
        chosen = (gpus or [0])[0]
    return Device(present[chosen][1], names[chosen])


def wide_cl() -> str:
    """OpenCL source that defines WIDE, an attribute of kernels with sixteen lanes."""
    return (files("cosim.compute") / "wide.cl").read_text()


@dataclass(eq=False)
class Device:
    """An open device with its queue and its compiled programs.

    Attributes:
        handle: pyopencl's device.
        name: "platform: device".
    """

    handle: Any
    name: str

    def __post_init__(self) -> None:
        self._programs: dict[tuple[str, tuple[str, ...]], Any] = {}
        self._kernels: dict[tuple[str, tuple[str, ...], str], SharedKernel] = {}
        lose_in_forks(self, "context", "queue")  # they would hang

    @property
    def driver(self) -> str:
        """Version of its driver."""
        return str(self.handle.driver_version).strip()

    @property
    def units(self) -> int:
        """Number of compute units; of a processor, its cores."""
        return int(self.handle.max_compute_units)

    @cached_property
    def gpu(self) -> bool:
        """Whether it is a GPU, whose work-groups must be large."""
        import pyopencl as cl

        return bool(self.handle.type & cl.device_type.GPU)

    def groups(self, items: int, on_processor: int) -> tuple[int, int]:
        """`items` work-items rounded up to whole work-groups, and the size of a work-group:
        `on_processor`, or that of a GPU, where other work-items hide the latency of each."""
        local = _LOCAL_GPU if self.gpu else on_processor
        return -(-items // local) * local, local

    @cached_property
    def context(self) -> Any:
        use("OpenCL")
        import pyopencl as cl

        return cl.Context([self.handle])

    @cached_property
    def queue(self) -> Any:
        use("OpenCL")
        import pyopencl as cl

        return cl.CommandQueue(self.context)

    def kernel(self, source: str, name: str, options: tuple[str, ...] = ()) -> Any:
        """A kernel of `source`, which any thread may call. Each (source, options) is compiled once
        in a process; pyopencl and PoCL store the binary on disk for later ones.

        Warnings of the compiler are shown with PYOPENCL_COMPILER_OUTPUT=1 alone: on processors
        without AVX-512, those of PoCL's own library are on every program."""
        import pyopencl as cl

        options = (*options, "-cl-kernel-arg-info")
        key = (source, options)
        if key not in self._programs:
            _check_cache(Path(os.environ["POCL_CACHE_DIR"]))  # it may have filled since the start
            shown = os.environ.get("PYOPENCL_COMPILER_OUTPUT")
            with warnings.catch_warnings(), compiles():
                if not shown:
                    warnings.simplefilter("ignore", cl.CompilerWarning)
                with self._checked_files(key):
                    self._programs[key] = cl.Program(self.context, source).build(
                        list(options) if shown else [*options, "-w"],
                        cache_dir=str(cache_folder() / "programs"),
                    )
        if (*key, name) not in self._kernels:
            self._kernels[*key, name] = SharedKernel(self._programs[key], name)
        return self._kernels[*key, name]

    def _checked_files(self, key: tuple[str, tuple[str, ...]]) -> AbstractContextManager[None]:
        """While a program is built: damaged files of PoCL's cache are dropped before."""
        if not self.name.startswith("Portable Computing Language"):
            return nullcontext()
        folder = Path(os.environ["POCL_CACHE_DIR"])
        files = pocl_files(folder, folder == cache_folder() / "pocl")
        told = repr((key, self.name, self.driver))
        name = hashlib.sha256(told.encode(errors="replace")).hexdigest()[:40]
        return nullcontext() if files is None else files.building(name)

    def upload(self, array: npt.NDArray[Any]) -> Any:
        """A device buffer with a copy of `array`."""
        import pyopencl as cl

        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self.context, flags, hostbuf=np.ascontiguousarray(array))

    def room(self, size: int) -> Any:
        """A device buffer of `size` bytes with any content."""
        import pyopencl as cl

        return cl.Buffer(self.context, cl.mem_flags.READ_WRITE, size)

    def memory(self, size: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """Memory of the host, (size,) with any values: for a GPU such that its driver need not copy
        it once more (H200: 54 instead of 14 GB/s)."""
        import pyopencl as cl

        if not self.gpu or not size:
            return np.empty(size, dtype)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.ALLOC_HOST_PTR
        pinned = cl.Buffer(self.context, flags, size * np.dtype(dtype).itemsize)
        kept = np.dtype(dtype)
        array, _ = cl.enqueue_map_buffer(self.queue, pinned, cl.map_flags.WRITE, 0, (size,), kept)
        return array

    def share(self, array: npt.NDArray[Any], *, write: bool = False) -> Any:
        """A device buffer over the memory of a contiguous `array`, without a copy on processors.

        The array must not change while kernels read it. With `write`, `settle` returns what kernels
        have written."""
        import pyopencl as cl

        if write and self.gpu:
            return self.upload(array)
        access = cl.mem_flags.READ_WRITE if write else cl.mem_flags.READ_ONLY
        return cl.Buffer(self.context, access | cl.mem_flags.USE_HOST_PTR, hostbuf=array)

    def target(self, array: npt.NDArray[Any]) -> Any:
        """As `share` with `write`, for kernels that write the whole array and read none of it."""
        return self.room(array.nbytes) if self.gpu else self.share(array, write=True)

    def settle(self, buffer: Any, array: npt.NDArray[Any]) -> None:
        """Waits for the queue; the array of a shared buffer then has the output of the kernels."""
        import pyopencl as cl

        if self.gpu:
            cl.enqueue_copy(self.queue, array, buffer)
            return
        view, _ = cl.enqueue_map_buffer(
            self.queue, buffer, cl.map_flags.READ, 0, array.shape, array.dtype, is_blocking=False
        )
        view.base.release(self.queue)
        self.finish()

    def download(self, buffer: Any, into: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Waits for the queue and copies a buffer back into `into`."""
        import pyopencl as cl

        cl.enqueue_copy(self.queue, into, buffer)
        return into

    def fetch(self, buffer: Any, into: npt.NDArray[Any]) -> Any:
        """Copies a buffer into `into`, which is valid after the queue is empty. The result must be
        kept until then."""
        import pyopencl as cl

        return cl.enqueue_copy(self.queue, into, buffer, is_blocking=False)

    def finish(self) -> None:
        """Waits until the queue is empty."""
        self.queue.finish()
