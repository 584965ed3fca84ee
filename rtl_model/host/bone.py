"""The master of a board's bus over any line, and the one place that opens it by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Protocol

from rtl_model.host.ether import Etherbone, is_udp, open_udp
from rtl_model.host.log import LineLog, Logged
from rtl_model.host.ports import AS_EVER, Lines, open_port
from rtl_model.host.uartbone import PATIENCE_S, SIMULATED_PATIENCE_S, Uartbone


class Bone(Protocol):
    """Words at byte addresses: `Uartbone` over a serial line, `Etherbone` over UDP."""

    @property
    def confirms(self) -> bool:
        """Whether a write that returns has been performed once, and answers have checksums."""

    @property
    def time_scale(self) -> float:
        """Seconds of the host's time to a second of the board's clock."""

    @property
    def patience_s(self) -> float:
        """Longest usual wait for an answer, s."""

    @property
    def port(self) -> Logged:
        """The port, whose clock times everything."""

    @property
    def words_at_once(self) -> int:
        """Most words of one transaction."""

    def read(
        self, address: int, words: int = 1, *, fixed: bool = False, retry: bool | None = None
    ) -> list[int]:
        """Reads words; see `Uartbone.read`."""

    def read_twice(self, address: int, words: int = 1) -> list[int]:
        """Reads words that do not change by themselves, without an undetected error."""

    def write(self, address: int, values: Sequence[int] | int, *, fixed: bool = False) -> None:
        """Writes words; see `Uartbone.write`."""

    def other_answer(
        self, address: int, got: list[int], right: list[int], *, counted: bool = False
    ) -> None:
        """Reports an answer that was wrong once."""

    def resynchronise(self) -> int:
        """Brings the line into a known state."""

    def pause(self, seconds: float) -> None:
        """Waits."""

    def line_s(self, count: int) -> float:
        """Duration of `count` bytes on the line, s; 0 if unknown."""


def patience_s(simulated: bool, time_scale: float) -> float:
    """Longest usual wait for an answer beyond the line's time, s."""
    return (SIMULATED_PATIENCE_S if simulated else PATIENCE_S) * max(1.0, time_scale)


@contextmanager
def opened_bone(
    url: str,
    baud: int,
    *,
    simulated: bool = False,
    time_scale: float = 1.0,
    log: Path | None = None,
    low_latency: bool = False,
    lines: Lines = AS_EVER,
) -> Iterator[tuple[Uartbone | Etherbone, bool]]:
    """Opens a port by name, until the end of the context.

    Args:
        url: a device, a URL of pyserial, or `udp:HOST[:PORT]`.
        baud: baud of a serial line.
        simulated: whether a simulated board is behind it, for which the host waits longer.
        time_scale: seconds of the host's time to a second of the board's clock.
        log: file that records every transaction, None for none.
        low_latency: whether the driver of a serial port is asked for its low-latency mode.
        lines: modem lines of a serial port to set.

    Yields:
        The master of the bus, and whether the low-latency mode was granted.

    Raises:
        LineFault: as `open_port`.
        InputError: for a name or baud that cannot be used, a log that cannot be written, or a board
            over UDP that does not answer.
    """
    patience = patience_s(simulated, time_scale)
    with ExitStack() as stack:
        if is_udp(url):
            socket = open_udp(url)
            stack.callback(socket.close)
            recorder = _recorder(stack, log, socket, simulated, time_scale)
            ether = Etherbone(socket, time_scale=time_scale, patience_s=patience, log=recorder)
            ether.require_answer()
            yield ether, False
            return
        port = open_port(url, baud, lines=lines)
        stack.callback(port.close)
        granted = low_latency and port.low_latency()
        recorder = _recorder(stack, log, port, simulated, time_scale)
        yield (
            Uartbone(port, baud=baud, time_scale=time_scale, patience_s=patience, log=recorder),
            granted,
        )


def check_answers(url: str, simulated: bool, time_scale: float) -> None:
    """Raises InputError, which says what to check, unless a board over UDP answers a probe."""
    with opened_bone(url, 1, simulated=simulated, time_scale=time_scale):
        return


def _recorder(
    stack: ExitStack, log: Path | None, port: Logged, simulated: bool, time_scale: float
) -> LineLog | None:
    if log is None:
        return None
    session: Mapping[str, object] = {"simulated": simulated, "time_scale": time_scale}
    return stack.enter_context(LineLog(log, port, session=session))
