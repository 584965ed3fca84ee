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
import subprocess
import warnings
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from threading import Lock
from typing import Any, Final

import numpy as np
import numpy.typing as npt

import cosim.compute.cores  # noqa: F401  # it limits the threads of PoCL
from cosim.compute.cache_folder import cache_folder, prepare_caches
from cosim.compute.compiling import compiles
from cosim.compute.forks import lose_in_forks, python_child, use
from cosim.compute.kernels import SharedKernel
from cosim.compute.memory import largest_file
from cosim.compute.pocl_files import pocl_files
from cosim.errors import InputError, MissingPackages, quote

_SHARED: Final[dict[str | None, Device | None]] = {}
"""Devices that are open for the whole process, by what was wanted."""
_OPENING: Final = Lock()
_PACKAGES = ("pocl-opencl-icd", "ocl-icd-libopencl1")
"""Debian packages that provide the processor as an OpenCL device."""
INSTALL = f"apt-get install {' '.join(_PACKAGES)}"

_KERNELS = 32 << 20
"""Free disk space that the compiler needs for a run, bytes: it writes some tens of kernels."""
_FILE = 2 << 20
"""Largest file that the compiler must be able to write, bytes; ours have up to 0.2 MiB."""
_LOCAL_GPU = 64
"""Work-items of a work-group on a GPU; 32 and 128 differ by 1 %."""
_PROBE = """
import json, pyopencl as cl
print(json.dumps([
    {"platform": p.name.strip(), "device": d.name.strip(), "version": d.version.strip(),
     "units": d.max_compute_units}
    for p in cl.get_platforms() for d in p.get_devices()]))
"""


def probe() -> list[dict[str, Any]]:
    """The OpenCL devices of this machine, found by a child process, which may abort.

    Returns:
        A dictionary for each device, in the order of their numbers: platform, device, version,
        units. Empty if there is none, or if the child aborted or did not end.
    """
    prepare_caches()
    try:
        child = subprocess.run(python_child(_PROBE), capture_output=True, timeout=60)
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
    """Raises InputError if the disk of the cache is full, or the user's files must be small: the
    compiler works in files there, and would end the process or fail without a reason."""
    most = largest_file()
    if most < _FILE:
        raise InputError(
            "the limit of a file's size (ulimit -f)", f"{_FILE >> 10} KiB or more",
            f"{most / 1024:.3g} KiB", "raise it, or pass --device numba",
        )  # fmt: skip
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
    _check_text(wanted)
    return None if wanted is not None and wanted.lower() == "numba" else open_device(wanted)


def _check_text(wanted: Any) -> None:
    """Raises InputError for what names no device."""
    if wanted is not None and not isinstance(wanted, str):
        raise InputError(
            "device", 'its number or part of its name, as a text, or "numba"', quote(wanted),
            f'write "{wanted}"' if isinstance(wanted, int) else "give one",
        )  # fmt: skip


def shared_device(wanted: str | None) -> Device | None:
    """The device of `choose_device` that a process shares, with its compiled programs."""
    _check_text(wanted)
    with _OPENING:
        if wanted not in _SHARED:
            _SHARED[wanted] = choose_device(wanted)
        return _SHARED[wanted]


def open_device(wanted: str | None = None) -> Device:
    """The device that is meant; without `wanted`, the first GPU, or else the first device.

    Args:
        wanted: number of the device in the order of `probe`, from 0, or part of its "platform:
            device" text, in any case; a number that no device has is a part of it.

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
        numbers = [i for i in range(len(names)) if wanted == str(i)]
        hits = numbers or [i for i, name in enumerate(names) if wanted.lower() in name.lower()]
        if not hits:
            choice = "; ".join(f"{number}: {name}" for number, name in enumerate(names))
            raise _no_device(repr(wanted), f"choose a number or a name of: {choice}; or numba")
        chosen = hits[0]
    else:
        gpus = [i for i, (_, d) in enumerate(present) if d.type & cl.device_type.GPU]
        chosen = (gpus or [0])[0]
    return Device(present[chosen][1], names[chosen], chosen)


def wide_cl() -> str:
    """OpenCL source that defines WIDE, an attribute of kernels with sixteen lanes."""
    return (files("cosim.compute") / "wide.cl").read_text(encoding="utf-8")


@dataclass(eq=False)
class Device:
    """An open device with its queue and its compiled programs.

    Attributes:
        handle: pyopencl's device.
        name: "platform: device".
        number: index of the device in the order of `probe`; devices of one name differ in it.
    """

    handle: Any
    name: str
    number: int = 0

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
        """An uninitialised device buffer of `size` bytes."""
        import pyopencl as cl

        return cl.Buffer(self.context, cl.mem_flags.READ_WRITE, size)

    def memory(self, size: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """Memory of the host, (size,), uninitialised: for a GPU such that its driver need not copy
        it once more (H200: 54 instead of 14 GB/s)."""
        import pyopencl as cl

        if not self.gpu or not size:
            return np.empty(size, dtype)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.ALLOC_HOST_PTR
        pinned = cl.Buffer(self.context, flags, size * np.dtype(dtype).itemsize)
        kind = np.dtype(dtype)
        array, _ = cl.enqueue_map_buffer(self.queue, pinned, cl.map_flags.WRITE, 0, (size,), kind)
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
