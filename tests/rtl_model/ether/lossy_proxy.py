"""A UDP proxy that loses, repeats and reorders datagrams by a seeded generator."""

import random
import select
import socket
import threading


class LossyProxy:
    """Stands between one host and a board, from the start of the context to its end.

    Args:
        board: (host, port) of the board.
        seed: of the generator.
        loss, repeat, reorder: share of datagrams, in each direction.

    Attributes:
        url: name that a host opens.
        lost, repeated, reordered: numbers of datagrams by direction, "to" and "from" the board.
    """

    def __init__(self, board, seed=1, loss=0.01, repeat=0.01, reorder=0.01):
        self._board = board
        self._random = random.Random(seed)
        self._shares = loss, repeat, reorder
        self.lost, self.repeated, self.reordered = ({"to": 0, "from": 0} for _ in range(3))
        self._held = {"to": [], "from": []}

    def __enter__(self):
        self._front, self._back = (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)
        )
        self._front.bind(("127.0.0.1", 0))
        self._back.connect(self._board)
        self._host = None
        self.url = f"udp:127.0.0.1:{self._front.getsockname()[1]}"
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *error):
        self._stop.set()
        self._thread.join()
        self._front.close()
        self._back.close()

    def _run(self):
        while not self._stop.is_set():
            ready, _, _ = select.select([self._front, self._back], [], [], 0.005)
            if self._front in ready:
                data, self._host = self._front.recvfrom(65536)
                self._carry("to", data)
            if self._back in ready:
                self._carry("from", self._back.recv(65536))
            if not ready:  # what was held back to be overtaken goes on, if nothing overtakes it
                for way, held in self._held.items():
                    while held:
                        self._send(way, held.pop(0))

    def _carry(self, way, data):
        loss, repeat, reorder = self._shares
        draw = self._random.random()
        if draw < loss:
            self.lost[way] += 1
            return
        if draw < loss + reorder:
            self.reordered[way] += 1
            self._held[way].append(data)
            return
        self._send(way, data)
        if draw < loss + reorder + repeat:
            self.repeated[way] += 1
            self._send(way, data)
        while self._held[way]:
            self._send(way, self._held[way].pop(0))

    def _send(self, way, data):
        if way == "to":
            self._back.send(data)
        elif self._host is not None:
            self._front.sendto(data, self._host)
