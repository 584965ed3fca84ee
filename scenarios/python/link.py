"""A link of light that is set up once and sends again and again, for Python."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from cosim import InputError
from cosim.compute.opencl import shared_device
from cosim.errors import quote
from link.core import Crossed, LinkCore
from link.mode import Mode
from link.setting import link_setting, steering_of
from scenarios.assemble.schema.loading import assignments_of, linked, load
from scenarios.assemble.source.link import link_camera
from scenarios.python.calls import Called, keys_of
from scenarios.python.errors import in_python

SIZE: Final = 100_000
"""Bytes of a call for which the mode is chosen, by default."""
_MOST: Final = 1_000_000_000
"""Bytes of a call, at most; those of a run."""


class Link(Called):
    """A panel, the air and a spike camera in memory: bytes in, the bytes that arrive out. Nothing
    is written.

    It is set up once: the mode is chosen by pilots, and the camera's clock is locked to the panel.
    What it sends is received as by `viform run light-link` with the same keys, bytes and seed. It
    may be called from several threads at once, and is a context manager.

    Args:
        size: Bytes of a call for which the mode is chosen. Calls of other sizes have the same mode.
        tolerance: Allowed error of the simulation, half-widths of the bit error rate's interval; 0
            keeps every effect. That of the scenario light-link if None.
        seed: Seed of the set-up and of the noise of call 0. Other calls have noise of their own,
            which depends on the seed and on their number alone.
        device: Number or part of the name of an OpenCL device, or "numba"; the default if None.
        **keys: Keys of the section [link], such as distance="2 m" or **{"panel.width": 256}, and of
            the section [sensor], such as **{"sensor.width": 300}.

    Raises:
        InputError: A key or value that the link does not have, or a link that cannot be simulated.
    """

    @in_python(section="link")
    def __init__(
        self, *, size: int = SIZE, tolerance: float | None = None, seed: int | None = None,
        device: str | None = None, **keys: Any,
    ) -> None:  # fmt: skip
        own = keys_of("link", keys, "sensor")
        self._set_up(own, size, tolerance, seed, device)

    @classmethod
    def of(
        cls, settings: dict[str, Any], size: int, tolerance: float | None, seed: int | None,
        device: str | None,
    ) -> Link:  # fmt: skip
        """The link of keys of a scenario. Raises InputError."""
        link = cls.__new__(cls)
        link._set_up(settings, size, tolerance, seed, device)
        return link

    def _set_up(
        self, settings: dict[str, Any], size: int, tolerance: float | None, seed: int | None,
        device: str | None,
    ) -> None:  # fmt: skip
        self._made = settings, size, tolerance, seed, device
        for key in settings:
            if key in ("link.file", "link.size", "link.loop") or key.partition(".")[0] not in (
                "link", "sensor",
            ):  # fmt: skip
                raise InputError(
                    key, "absent for a link in memory, which has keys of [link] and [sensor]",
                    "given", 'leave it out, or make a run by viform.send(data, out="folder")',
                )  # fmt: skip
        whole = isinstance(size, (int, np.integer)) and not isinstance(size, bool)
        if not (whole and 1 <= size <= _MOST):
            raise InputError("size", f"a whole number of bytes from 1 to {_MOST}", quote(size),
                             "change it")  # fmt: skip
        loaded = load("light-link", assignments_of(settings), tolerance=tolerance, seed=seed)[1]
        scenario = linked(loaded, "run")
        self._core = LinkCore(
            link_setting(scenario, link_camera(scenario)), scenario.link.modem,
            steering_of(scenario.sensor), shared_device(device), size=int(size),
            tolerance=scenario.tolerance, duplicated_rows=scenario.sensor.duplicated_rows,
        )  # fmt: skip
        Called.__init__(self)
        self._chip = scenario.sensor.chip

    def __reduce__(self) -> tuple[Any, ...]:
        """In another process the link is set up anew; its calls are counted from 0."""
        self._check_open()
        return Link.of, self._made

    @property
    def mode(self) -> Mode:
        """The mode of all calls: cells, ticks and codes."""
        return self._core.mode

    @property
    def camera_shape(self) -> tuple[int, int]:
        """(height, width) of the camera, pixels."""
        chip = self._core.chosen.setting.camera.chip
        return chip.height, chip.width

    def __repr__(self) -> str:
        mode, setting = self.mode, self._core.chosen.setting
        lock = ", clock locked" if self._core.chosen.locking is not None else ""
        return (
            f"Link: {self._chip}, {setting.air.distance:g} m from a panel of {mode.width} x "
            f"{mode.height} pixels, cells of {mode.cell} x {mode.cell}, symbols of {mode.ticks} "
            f"{'tick' if mode.ticks == 1 else 'ticks'}, {mode.line} and {mode.word_code}"
            f"{lock}{self._state}"
        )

    @in_python
    def send(self, data: bytes | bytearray | memoryview, *, call: int | None = None) -> Crossed:
        """Sends bytes.

        Args:
            data: bytes to send, at least one.
            call: Number of the call, from 0; the next one if None. Equal seeds, numbers and bytes
                give equal results.

        Returns:
            What arrived: `received`, `intact`, `ber`, `goodput_bps`, and `error`, the bounds of
            what was left out.

        Raises:
            InputError: No bytes, or a closed link.
        """
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise InputError(
                "data", "bytes", type(data).__name__,
                "convert it, or read the file" if isinstance(data, str) else "convert it",
            )  # fmt: skip
        whole = bytes(data)
        if not 1 <= len(whole) <= _MOST:
            raise InputError(
                "data", f"from 1 to {_MOST} bytes", "none" if not whole else f"{len(whole)}",
                "give others",
            )  # fmt: skip
        return self._core.send(whole, self._number(call))
