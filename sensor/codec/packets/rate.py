"""Rate control: which layers of which tiles are sent, so that the link carries them in time.

Packets wait for the link in a send buffer, first in, first out: a leaky bucket. Half of it belongs
to the layers above 0, so that layer 0 of the next group finds room whatever came before. A tile's
layers are sent from coarse to fine as far as they gain most a bit: in the order of the slopes of
the upper convex hull of gain over bits (Shoham and Gersho 1988), which is the best choice for the
bits that the chosen ones take. Midpoints of steady trains take bits and gain little, so they go
first. Layer 0 is left out only where the buffer would overflow, and then with its whole tile, at
another place in every group.
"""

from __future__ import annotations

import heapq
from collections import defaultdict, deque

import numpy as np

from cosim.stage import State, section
from sensor.codec.packets.packet import Packet

Sent = tuple[Packet, int]
"""A packet that has left, and the cycles that it has waited."""
MOST_LAYERS = 8
SPREAD = 4
"""A group takes one in SPREAD of the bits that are free, so that groups are equally good."""
COUNTERS = ("offered_bytes", "sent_bytes", "offered_spikes", "dropped_spikes", "dropped_packets",
            "dropped_tiles")  # fmt: skip


class RateControl:
    """Chooses among the packets of each group, and sends the chosen ones through a buffer.

    A packet waits at most `buffer_bytes` / budget cycles, and nothing is ever waited for.

    Attributes:
        budget: bits a cycle that the link carries; may be set anew between groups.
        buffer: what waits for it.
        layers_sent: packets sent of each layer.
    """

    def __init__(self, budget_bits_per_cycle: float, buffer_bytes: int) -> None:
        if not budget_bits_per_cycle > 0:
            raise ValueError(f"the budget must be above 0 bit a cycle, not {budget_bits_per_cycle}")
        self.budget, self.buffer = budget_bits_per_cycle, SendBuffer(buffer_bytes)
        self.layers_sent = [0] * MOST_LAYERS
        self._counts = dict.fromkeys(COUNTERS, 0)
        self._groups = 0
        self._before = self._offered = 0

    @property
    def statistics(self) -> dict[str, int]:
        """Totals: bytes and spikes offered, bytes sent; packets that were left out and the spikes
        whose times only they had; tiles of which nothing was sent, once for each group."""
        return dict(self._counts)

    def offer(self, packets: list[Packet], now: int) -> list[Packet]:
        """Puts the packets of one group that may be sent into the buffer; those that may not.

        packets: all of one group. now: the cycle at which they are there. The group takes what
            the link carries in as many cycles as there were since the last one, and a part of what
            is free of the buffer, or all of that if it is then sent whole.
        """
        tiles: dict[int, list[Packet]] = defaultdict(list)
        for packet in sorted(packets, key=lambda p: (p.tile, p.layer)):
            tiles[packet.tile].append(packet)
        depth = self._bases(tiles)
        carried, self._offered = int(self.budget * (now - self._offered)), now
        spare = 4 * self.buffer.limit - 8 * self.buffer.size
        whole = sum(p.size for p in packets)
        if 8 * whole <= carried + spare and whole <= self.buffer.free:
            depth = {tile: len(layers) for tile, layers in tiles.items()}
        else:
            spare = spare // SPREAD if spare > 0 else spare
            self._refine(tiles, depth, carried + spare)
        self._groups += 1
        left_out = []
        for layer in range(MOST_LAYERS):
            for tile, layers in tiles.items():
                if layer < depth.get(tile, 0):
                    self.buffer.push(layers[layer], now)
                    self.layers_sent[layer] += 1
                    self._counts["sent_bytes"] += layers[layer].size
                elif layer < len(layers):
                    left_out.append(layers[layer])
        self._counts["offered_bytes"] += whole
        self._counts["offered_spikes"] += sum(p.spikes for p in packets)
        self._counts["dropped_spikes"] += sum(p.spikes for p in left_out)
        self._counts["dropped_packets"] += len(left_out)
        self._counts["dropped_tiles"] += len(tiles) - len(depth)
        return left_out

    def _bases(self, tiles: dict[int, list[Packet]]) -> dict[int, int]:
        """Tile -> 1, if the buffer holds its layer 0, beginning at another tile in each group."""
        names = sorted(tiles)
        turn = self._groups * (len(names) // 3 + 1) % max(len(names), 1)
        free, depth = self.buffer.free, {}
        for tile in names[turn:] + names[:turn]:
            if tiles[tile][0].size <= free:
                free -= tiles[tile][0].size
                depth[tile] = 1
        return depth

    def _refine(self, tiles: dict[int, list[Packet]], depth: dict[int, int], room: int) -> None:
        """Sends more layers of the tiles in `depth` while `room` bits last."""
        room = min(room, 8 * self.buffer.free)
        room -= sum(8 * tiles[tile][0].size for tile in depth)
        steps: list[tuple[float, int, int, int]] = []

        def step(tile: int) -> None:
            """The steepest next step of a tile onto the heap."""
            best, size, gain = (0.0, 0, 0), 0, 0.0
            for n, packet in enumerate(tiles[tile][depth[tile] :], depth[tile] + 1):
                size, gain = size + 8 * packet.size, gain + packet.gain
                best = min(best, (-gain / size, n, size)) if best[1] else (-gain / size, n, size)
            if best[1]:
                heapq.heappush(steps, (best[0], tile, best[1], best[2]))

        for tile in depth:
            step(tile)
        while steps:
            _, tile, n, size = heapq.heappop(steps)
            if size <= room:
                room -= size
                depth[tile] = n
                step(tile)

    def send(self, now: int, bits: int | None = None) -> list[Sent]:
        """Packets that have left by cycle `now`, and the cycles that each has waited.

        bits: number of bits that the link has carried since the last call; those of the budget
            when None.
        """
        if bits is None:
            bits = int(self.budget * now) - int(self.budget * self._before)
        self._before = now
        return self.buffer.send(bits, now)

    def state(self) -> State:
        """Counters and the buffer."""
        counts = [
            self._groups,
            self._before,
            self._offered,
            *self._counts.values(),
            *self.layers_sent,
        ]
        buffer = {f"buffer/{name}": value for name, value in self.buffer.state().items()}
        return {"counts": np.array(counts, np.int64), "budget": np.array([self.budget]), **buffer}

    def restore(self, state: State) -> None:
        """Goes on from a state."""
        self._groups, self._before, self._offered, *rest = (int(n) for n in state["counts"])
        self._counts = dict(zip(COUNTERS, rest, strict=False))
        self.layers_sent = rest[len(COUNTERS) :]
        self.budget = float(state["budget"][0])
        self.buffer.restore(section(state, "buffer"))


class SendBuffer:
    """A queue of a limited number of bytes.

    Attributes:
        limit: bytes that it holds at most.
        size, peak: bytes in it, and the most so far.
        longest: cycles that a packet has waited at most.
    """

    def __init__(self, limit: int) -> None:
        if limit < 1:
            raise ValueError(f"a send buffer must hold bytes, not {limit}")
        self.limit, self.size, self.peak, self.longest = limit, 0, 0, 0
        self._queue: deque[tuple[Packet, int]] = deque()
        self._credit = 0

    @property
    def free(self) -> int:
        """Bytes that it can still take."""
        return self.limit - self.size

    def push(self, packet: Packet, now: int) -> None:
        """Adds a packet at cycle `now`. Raises ValueError where it does not fit."""
        if packet.size > self.free:
            raise ValueError(f"a packet must have at most {self.free} bytes, not {packet.size}")
        self._queue.append((packet, now))
        self.size += packet.size
        self.peak = max(self.peak, self.size)

    def send(self, bits: int, now: int) -> list[Sent]:
        """Packets whose last bit has left by cycle `now`, after the link has carried `bits` more.

        What the link could have carried while there was nothing to send is lost.
        """
        self._credit += bits
        sent = []
        while self._queue and 8 * self._queue[0][0].size <= self._credit:
            packet, since = self._queue.popleft()
            self._credit -= 8 * packet.size
            self.size -= packet.size
            self.longest = max(self.longest, now - since)
            sent.append((packet, now - since))
        if not self._queue:
            self._credit = 0
        return sent

    def state(self) -> State:
        """The packets in it and its counters."""
        data = [packet.to_bytes() for packet, _ in self._queue]
        return {
            "packets": np.frombuffer(b"".join(data), np.uint8).copy(),
            "lengths": np.array([len(one) for one in data], np.int64),
            "since": np.array([since for _, since in self._queue], np.int64),
            "counts": np.array([self.size, self.peak, self.longest, self._credit], np.int64),
        }

    def restore(self, state: State) -> None:
        """Goes on from a state. Spikes and gains of packets, which were used before, are 0."""
        self._queue.clear()
        data, place = state["packets"].tobytes(), 0
        for length, since in zip(state["lengths"], state["since"], strict=True):
            self._queue.append((Packet.of(data[place : place + int(length)]), int(since)))
            place += int(length)
        self.size, self.peak, self.longest, self._credit = (int(n) for n in state["counts"])
