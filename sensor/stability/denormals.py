"""Case 17: the same bits with denormal numbers on or off.

A processor may take numbers below the least normal one for 0, and libraries turn that on behind
one's back. What a run gives must not depend on it.
"""

from __future__ import annotations

import ctypes
import json
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Clock
from cosim.compute.cores import by_rows
from cosim.compute.forks import python_child
from cosim.compute.opencl import Device, open_device
from cosim.run.case import Case
from sensor import EFFECTS, make_pixels
from sensor.asynchronous import AsynchronousPixels, EventModel
from sensor.latched.pixel.charge import ONE, Span
from sensor.latched.pixel.model import ExactModel
from sensor.stability.gathering import constant

_PLACE: Final = {"x86_64": (28, 0x8040), "aarch64": (0, 1 << 24)}
"""Place of the control word in the C library's saved environment, and its bits that flush: MXCSR
after the 28 bytes of the x87 (FTZ, DAZ: Intel SDM 1, 10.2.3), FPCR first (FZ: Arm ARM, FPCR)."""
_TINY: Final = 1e-42
"""Denormal in float32."""
Forms = Callable[[bool], Mapping[str, str]]
"""(flush) -> result of each form of the pixel, and of `canary`, which denormal numbers change."""


@contextmanager
def flushing() -> Iterator[None]:
    """Denormal numbers are taken to be 0 in this thread, and in those that it starts."""
    if platform.machine() not in _PLACE:
        raise RuntimeError(f"denormal numbers cannot be turned off on {platform.machine()}")
    place, bits = _PLACE[platform.machine()]
    library = ctypes.CDLL("libm.so.6")
    before = ctypes.create_string_buffer(64)
    library.fegetenv(before)
    changed = bytearray(before.raw)
    word = int.from_bytes(changed[place : place + 4], sys.byteorder) | bits
    changed[place : place + 4] = word.to_bytes(4, sys.byteorder)
    library.fesetenv(ctypes.create_string_buffer(bytes(changed), 64))
    try:
        yield
    finally:
        library.fesetenv(before)


@njit(cache=True, nogil=True)
def _halve(n0, n1, values):  # type: ignore[no-untyped-def]
    for n in range(n0, n1):
        values[n] *= np.float32(0.5)


def _halves(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Half of each value, on the threads that the compiled pixel runs on."""
    out = values.copy()
    by_rows(_halve, out.size, out, least=0)
    return out


class _Flushing(Device):
    """A device whose kernels are built to take denormal numbers for 0."""

    def kernel(self, source: str, name: str, options: tuple[str, ...] = ()) -> Any:
        return super().kernel(source, name, (*options, "-cl-denorms-are-zero"))


def _digest(*arrays: Any) -> str:
    return sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()


def forms(device: Device | None) -> dict[str, str]:
    """A digest of what each form makes of bright, dim and denormal light, here and now."""
    n, cycles = 512, 320
    light = np.geomspace(_TINY, 300, n).astype(np.float32)
    charge = np.rint(light.astype(np.float64) * ONE).astype(np.int64)
    model = ExactModel(100.0, 3, tuple(EFFECTS.values()))
    spans = [Span(0, 160, charge, charge // 320), Span(160, 160, charge)]
    made = {"canary": _digest(_halves(np.full(64, _TINY, np.float32)))}
    for name, target in (("compiled", None), ("kernel", device)):
        pixels = make_pixels(model, np.arange(n, dtype=np.uint32), target)
        words = pixels.expose(spans, cycles)
        state = pixels.state()
        made[name] = _digest(words, state.deficit, state.spikes)
    clock = Clock(10**9)
    events = AsynchronousPixels(EventModel(100, 3, clock, shortest=1000), (1, n), 1e4)
    fired = events.step(constant(light, 10**9), 0, 10**9)
    made["asynchronous"] = _digest(fired.pixel, fired.instant, fired.exact)
    return made


def child(name: str) -> None:
    """Prints what the forms make while denormal numbers are taken for 0. name: number of the
    device, empty for numba."""
    with flushing():
        device = open_device(name) if name else None
        print(json.dumps(forms(_Flushing(device.handle, device.name) if device else None)))


def _forms(device: Device | None) -> Forms:
    def run(flush: bool) -> Mapping[str, str]:
        if not flush:
            return forms(device)
        # In a process of its own: threads that numba has already started keep their setting.
        call = f"from {__name__} import child; child({str(device.number) if device else ''!r})"
        done = subprocess.run(
            python_child(call), capture_output=True, encoding="utf-8", errors="replace"
        )
        if done.returncode:
            raise RuntimeError(done.stderr.strip().rpartition("\n")[2])
        made: dict[str, str] = json.loads(done.stdout)
        return made

    return run


def denormals(run: Forms) -> float:
    """Forms whose results differ; infinite where turning denormal numbers off had no effect."""
    on, off = dict(run(False)), dict(run(True))
    if on.pop("canary") == off.pop("canary"):
        return float("inf")
    return float(sum(on[name] != off[name] for name in on))


DENORMALS: Final = (
    Case(
        17,
        "denormal numbers on and off",
        "identical bits of kernel, compiled and asynchronous pixel",
        "the same run with FTZ and DAZ set, kernels built with -cl-denorms-are-zero",
        "squares of charge in coulombs, float32",
        "forms that differ",
        0.0,
        denormals,
        _forms,
    ),
)
