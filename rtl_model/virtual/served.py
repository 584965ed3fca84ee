"""A simulated board that a thread serves, from start to stop."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self

from cosim import ViformError
from rtl_model.geometry import Geometry
from rtl_model.virtual.pace import MARGIN

_ATTENTION_S = 0.2  # interval at which `wait` checks the thread


class Served:
    """Start, end and failure of the thread. A subclass opens its port and gives the turns.

    Attributes:
        geometry: geometry of the build.
        speed: measured simulation speed, clocks of the board per second of wall time.
        clock: clocks simulated since the last power-on.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.speed = float(geometry.clock_hz)
        self.clock = 0
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self._close: Callable[[], None] = lambda: None

    @property
    def port(self) -> str:
        """Name that a host opens."""
        raise NotImplementedError

    @property
    def clocks_per_second(self) -> float:
        """Clocks of the board per second of wall time, at most its nominal clock."""
        return min(self.speed, float(self.geometry.clock_hz))

    @property
    def time_scale(self) -> float:
        """Factor by which a host should lengthen its waiting times.

        It is the ratio of nominal to measured clock with a margin for a busy machine, at least 1.
        """
        return max(1.0, MARGIN * self.geometry.clock_hz / self.speed)

    @property
    def alive(self) -> bool:
        """Whether the board is being served."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> Self:
        """Opens the port and serves it until `stop`."""
        raise NotImplementedError

    def wait(self, ended: threading.Event) -> None:
        """Waits until the event is set, or the board ends by itself, which is a failure."""
        while self.alive and not ended.wait(_ATTENTION_S):
            pass

    def stop(self) -> None:
        """Ends the board and closes the port. Raises ViformError if the board has failed."""
        if self._thread is None:
            return
        os.write(self._wake, b"x")
        self._thread.join()
        self._thread = None
        os.close(self._wake)
        os.close(self._waker)
        self._close()
        if self._failure is not None:
            raise ViformError("the virtual board ended early") from self._failure

    def __enter__(self) -> Self:
        try:
            return self.start()
        except BaseException:
            if self.alive:
                self.stop()
            raise

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _serve(
        self,
        server: Callable[[int], Callable[[], bool]],
        close_port: Callable[[], None],
        close_simulator: Callable[[], None],
    ) -> None:
        """Starts the thread.

        Args:
            server: returns the function of one turn, which tells whether another follows. Its
                argument is a file that becomes readable when the board must end.
            close_port: called when the thread has ended, or cannot begin.
            close_simulator: called by the thread at its end.
        """
        self._close = close_port
        try:
            self._waker, self._wake = os.pipe()
            self._thread = threading.Thread(
                target=self._run, args=(server, close_simulator), daemon=True
            )
            self._thread.start()
        except BaseException:  # such as a request to end
            close_port()
            raise

    def _run(
        self, server: Callable[[int], Callable[[], bool]], close_simulator: Callable[[], None]
    ) -> None:
        try:
            turn = server(self._waker)
            while turn():
                pass
        except BaseException as exc:  # `stop` raises it
            self._failure = exc
        finally:
            close_simulator()
