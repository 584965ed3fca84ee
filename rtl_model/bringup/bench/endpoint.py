"""The board that `--port` or `board.port` names.

It is a real board behind a port, or a virtual board, which runs as long as the endpoint is open.

The commands of `viform board` import this file when the program starts, so everything else is
imported in the functions that need it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtl_model.geometry import Geometry
    from rtl_model.host import CsrMap, Lines
    from rtl_model.host.ports import Level as Line
    from rtl_model.registers.design import Device, Devices
    from rtl_model.virtual import Level, VirtualBoard
    from rtl_model.virtual.ethernet import EthernetBoard

VIRTUAL = "virtual"
"""Name of the port that starts a virtual board."""


@dataclass(frozen=True)
class Endpoint:
    """A port with a board behind it.

    Attributes:
        url: URL of the port, for `opened_bone`.
        baud: baud of a serial line.
        simulated: whether a simulated board is behind the port.
        time_scale: seconds of the host's time to a second of the board's clock.
        lines: modem lines of a serial port to set.
    """

    url: str
    baud: int
    simulated: bool
    time_scale: float
    lines: Lines

    @property
    def stages(self) -> tuple[str, ...]:
        """Names of the stages of a bring-up."""
        from rtl_model.bringup.bench.stage import STAGES, UDP_STAGES
        from rtl_model.host.ether import is_udp

        return UDP_STAGES if is_udp(self.url) else STAGES


def checked_level(level: str) -> Level:
    """`level` itself. Raises InputError for an unknown level of simulation."""
    from cosim import InputError
    from rtl_model.virtual import LEVELS

    known = next((name for name in LEVELS if name == level), None)
    if known is None:
        raise InputError("--level", "one of " + ", ".join(LEVELS), repr(level), "choose one")
    return known


def virtual_board(
    *,
    baud: int,
    level: str = "bytes",
    faults: Sequence[str] | None = None,
    geometry: Geometry | None = None,
    link: Path | None = None,
    device: Device | None = None,
    udp: str | None = None,
) -> VirtualBoard | EthernetBoard:
    """A virtual board that is not started yet.

    Args:
        baud: baud of the board's line.
        level: level of simulation, one of `rtl_model.virtual.LEVELS`.
        faults: faults to inject, such as "stuck=3,7".
        geometry: geometry of the build; by default 32 x 32 at a clock that the simulator reaches.
        link: symbolic link to make for its port.
        device: another device to simulate instead, such as a conventional imager.
        udp: `udp:HOST[:PORT]` to serve Etherbone at instead of a pty.

    Raises InputError for an unknown level or fault, and for a baud that the clock does not allow.
    """
    from cosim import InputError
    from rtl_model.geometry import Geometry
    from rtl_model.virtual import VirtualBoard, nominal_clock

    known = checked_level(level)
    size = geometry or Geometry(clock_hz=nominal_clock(known, baud), baud=baud)
    if size.bit_clocks < 4:
        must = f"at most a quarter of the virtual board's clock, {size.clock_hz // 4}"
        raise InputError("--baud", must, str(baud), "lower it")
    if udp is not None:
        from rtl_model.virtual.ethernet import EthernetBoard

        return EthernetBoard(udp, size, level=known, faults=faults or (), device=device)
    return VirtualBoard(size, level=known, faults=faults or (), link=link, device=device)


@contextmanager
def open_endpoint(
    port: str,
    baud: int | None,
    time_scale: float | None,
    *,
    simulated: bool | None = None,
    level: str = "bytes",
    faults: Sequence[str] | None = None,
    geometry: Geometry | None = None,
    dtr: Line | None = None,
    rts: Line | None = None,
) -> Iterator[Endpoint]:
    """The endpoint of `--port`; a virtual board is started, and stopped at the end of the context.

    Args:
        port: a device, a URL of pyserial, `udp:HOST[:PORT]`, or `VIRTUAL`.
        baud: baud of a serial line; None for 115 200, and with a board over UDP.
        time_scale: seconds of the host's time to a second of the board's clock; None for 1, or
            for the measured value of a virtual board.
        simulated: whether a simulated board is behind the port; None: true for a pty and a
            loopback address only.
        level, faults, geometry: level, faults and geometry of a virtual board.
        dtr, rts: modem lines of a serial port to set.
    """
    from cosim import InputError
    from rtl_model.geometry import Geometry
    from rtl_model.host import Lines, is_pty
    from rtl_model.host.ether import is_loopback, is_udp

    if time_scale is not None and not 0 < time_scale < 1e6:
        raise InputError("--time-scale", "above 0", str(time_scale), "1 is a real board's")
    if baud is not None and baud <= 0:
        raise InputError("--baud", "above 0", str(baud), "115200 is common")
    if baud is not None and is_udp(port):
        raise InputError("--baud", "given with a serial port", f"with {port}", "leave it out")
    if (dtr or rts) and is_udp(port):
        raise InputError(
            "--dtr and --rts", "given with a serial port", f"with {port}", "leave them out"
        )
    baud, lines = baud or Geometry().baud, Lines(dtr, rts)
    if port != VIRTUAL:
        if faults or level != "bytes":
            raise InputError(
                "--fault and --level", "given with --port virtual", f"with {port}", "leave them out"
            )
        if simulated is None:
            simulated = is_loopback(port) if is_udp(port) else is_pty(port)
        yield Endpoint(port, baud, simulated, time_scale or 1.0, lines)
        return
    if simulated is False:
        raise InputError(
            "--real", "given with the port of a board", f"with --port {port}", "leave it out"
        )
    with virtual_board(baud=baud, level=level, faults=faults, geometry=geometry) as board:
        yield Endpoint(board.port, baud, True, time_scale or board.time_scale, lines)


def csr_map(csr: Path | None, devices: Devices) -> CsrMap | None:
    """The register map of a csr.csv file; None without a file, for the Viform board.

    Args:
        csr: the file, or None.
        devices: devices whose registers are known beyond what the file states.

    Raises InputError for a file that is not a csr.csv.
    """
    from rtl_model.host import read_csr

    return None if csr is None else read_csr(csr, devices)
