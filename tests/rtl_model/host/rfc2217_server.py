"""A serial server that negotiates by RFC 2217, in front of the port of a board."""

from __future__ import annotations

import socket
import threading
import time
from types import TracebackType

import serial
from serial.rfc2217 import PortManager


class _Pty(serial.Serial):
    """Omits the modem lines, which the manager reports but a pty does not have."""

    cts = dsr = ri = cd = property(lambda self: False)

    def _update_dtr_state(self) -> None: ...

    def _update_rts_state(self) -> None: ...


class Rfc2217Server:
    """Serves one client at a time at `url`, from the context's begin to its end.

    Args:
        port: of the board.

    Attributes:
        bauds: that clients have asked for, in their order.
    """

    def __init__(self, port: str) -> None:
        self._serial = _Pty(port, timeout=0.01)
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._listening.settimeout(0.05)
        self._running = True
        self.bauds: list[int] = []
        self._thread = threading.Thread(target=self._serve, daemon=True)

    @property
    def url(self) -> str:
        return f"rfc2217://127.0.0.1:{self._listening.getsockname()[1]}"

    def __enter__(self) -> Rfc2217Server:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._running = False
        self._thread.join()
        self._listening.close()
        self._serial.close()

    def _serve(self) -> None:
        while self._running:
            try:
                client, _ = self._listening.accept()
            except TimeoutError:
                continue
            with client:
                self._talk(client)

    def _talk(self, client: socket.socket) -> None:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.settimeout(0.001)

        class Connection:
            """Sends the manager's answers to negotiations."""

            def write(self, data: bytes) -> None:
                client.sendall(data)

        manager = PortManager(self._serial, Connection())
        looked = time.monotonic()
        while self._running:
            if self._serial.in_waiting:
                client.sendall(b"".join(manager.escape(self._serial.read(self._serial.in_waiting))))
            if time.monotonic() - looked > 1:
                manager.check_modem_lines()
                looked = time.monotonic()
            try:
                data = client.recv(4096)
            except TimeoutError:
                continue
            except OSError:
                return
            if not data:
                return
            self._serial.write(b"".join(manager.filter(data)))
            if not self.bauds or self.bauds[-1] != self._serial.baudrate:
                self.bauds.append(self._serial.baudrate)
