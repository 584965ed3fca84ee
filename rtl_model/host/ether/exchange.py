"""Requests and answers over a socket that loses, repeats and reorders datagrams.

Every request has a tag of its own, also when it is repeated, and the answer returns it. So an
answer is assigned to its request whatever their order, a second answer to it is recognised, and
every answer measures a round trip. A request is lost if later ones were answered, or if its answer
is overdue. If that answer arrives after all, the request was late.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeVar

from rtl_model.host.countdown import Countdown
from rtl_model.host.ether.packet import answered
from rtl_model.host.faults import Cause, LineFault

if TYPE_CHECKING:
    from rtl_model.host.log import LineLog

_LATER = 3  # answers to later requests that prove a loss, as in TCP (RFC 5681, section 3.2)
_GAIN, _VARIATION_GAIN = 1 / 8, 1 / 4  # of the smoothed round trip and its variation (RFC 6298)
_LEAST_WAIT_S = 20e-3  # before an answer is overdue: a busy machine may suspend a thread so long
_DOUBTFUL_WAIT_S = 50e-3  # least wait for an answer that may never come
_LISTEN_S = 0.1  # longest wait of `listen` for one datagram
_FIRST_WAIT = 0.1  # share of the patience before a round trip is known
_WINDOW, _MOST_WINDOW = 4.0, 128.0  # requests in flight: at first, and at most
_SILENCES = 4  # times the patience, after which an exchange without any answer is given up
_REMEMBERED = 4096  # requests given up, and answered ones, that are recognised later
_TAGS = 1 << 32

Kept = TypeVar("Kept")


class PacketPort(Protocol):
    """A port that exchanges datagrams.

    Attributes:
        name: name for messages.
        same_port: whether LiteEth's answers arrive here.
        refused: whether the system learnt that no program listens there.
    """

    name: str
    same_port: bool
    refused: bool

    def send(self, data: bytes) -> None:
        """Sends a datagram."""

    def receive(self, deadline_s: float) -> bytes | None:
        """The next datagram; None if none arrives within `deadline_s` seconds."""

    def now(self) -> float:
        """The port's monotonic time, s."""

    def close(self) -> None:
        """Closes the port; may be called twice."""


@dataclass
class Counts:
    """Numbers of packets, of whatever kind.

    Attributes:
        sent: requests.
        answered: requests with an answer.
        lost: requests that were given up, and no answer arrived later.
        late: requests whose answer arrived after they were given up.
        repeated: second answers to a request: a datagram was repeated on the way.
        reordered: answers that arrived after the answer to a later request.
        strange: datagrams that are no answer to a request of this session.
    """

    sent: int = 0
    answered: int = 0
    lost: int = 0
    late: int = 0
    repeated: int = 0
    reordered: int = 0
    strange: int = 0

    def since(self, before: Counts) -> Counts:
        """The differences from earlier counts."""
        names = [each.name for each in fields(self)]
        return Counts(*(getattr(self, name) - getattr(before, name) for name in names))


class Sent(NamedTuple):
    """A transmitted request.

    Attributes:
        key: key of the caller.
        order: number of the transmission.
        at: time, s.
        turn: number of the exchange.
    """

    key: int
    order: int
    at: float
    turn: int


class Exchange:
    """Requests in flight on a port.

    Attributes:
        port: port of the board.
        patience_s: longest usual wait for an answer, s.
        counts: counts of packets since the start.
        window: number of requests in flight that the board and the network have kept up with.
        round_trip_s: smoothed duration of a round trip, s; None before the first answer.
        least_wait_s: least time after which an answer is overdue, s.
    """

    def __init__(self, port: PacketPort, patience_s: float, log: LineLog | None = None) -> None:
        self.port, self.patience_s, self._log = port, patience_s, log
        self.counts = Counts()
        self.window = _WINDOW
        self.round_trip_s: float | None = None
        self._variation_s = 0.0
        self._tag = int.from_bytes(os.urandom(4), "big")  # answers to an earlier session differ
        self._order = 0
        self._turn = 0  # number of the exchange
        self._flying: dict[int, Sent] = {}
        self._left: dict[int, Sent] = {}  # of earlier exchanges, whose answers nobody needs
        self._given_up: dict[int, Sent] = {}
        self._done: dict[int, None] = {}
        self._newest = -1  # transmission whose answer has arrived
        self._silence = Countdown(_SILENCES * patience_s, patience_s, port.now)
        self._backed_off = 1.0
        self.least_wait_s = _LEAST_WAIT_S
        self._cut = -1  # transmission up to which a loss has reduced the window

    @property
    def flying(self) -> int:
        """Requests in flight."""
        return len(self._flying)

    @property
    def order(self) -> int:
        """Number of the next transmission."""
        return self._order

    @property
    def wait_s(self) -> float:
        """Time after which an answer is overdue, s."""
        if self.round_trip_s is None:
            usual = _FIRST_WAIT * self.patience_s
        else:
            usual = self.round_trip_s + 4 * self._variation_s
        return min(max(usual, self.least_wait_s) * self._backed_off, self.patience_s)

    def begin(self) -> None:
        """Starts an exchange: silence is counted from now on, and older requests are left."""
        self._silence.restart()
        self._backed_off = 1.0
        self.port.refused = False
        self._turn += 1
        for tag, sent in self._flying.items():
            _remember(self._left, tag, sent)
        self._flying.clear()

    def send(self, key: int, make: Callable[[int], bytes]) -> None:
        """Sends a request.

        Args:
            key: key by which the caller knows the request.
            make: returns the packet for a tag.
        """
        self._tag = tag = (self._tag + 1) % _TAGS
        data = make(tag)
        self._flying[tag] = Sent(key, self._order, self.port.now(), self._turn)
        self._order += 1
        self.counts.sent += 1
        if self._log is not None:
            self._log.packet("to-board", data)
        self.port.send(data)

    def receive(self) -> tuple[Sent, bytes] | None:
        """The next answer to a request of this exchange: the request, and words (big-endian).

        Returns None if none arrives before the oldest request is overdue. An answer to a request
        that was given up is returned too.

        Raises LineFault: GONE, or SILENT after a silence of four times the patience.
        """
        now = self.port.now()
        oldest = next(iter(self._flying.values()), None)
        due = now if oldest is None else oldest.at + self.wait_s
        while True:
            data = self.port.receive(max(0.0, due - now))
            if data is None:
                self._check_silence()
                return None
            if self._log is not None:
                self._log.packet("from-board", data)
            answer = answered(data)
            sent = None if answer is None else self._take(answer[0])
            if answer is not None and sent is not None and sent.turn == self._turn:
                return sent, answer[1]
            now = self.port.now()

    def overdue(self) -> list[Sent]:
        """Gives up lost requests; returns them, the oldest first."""
        now, wait = self.port.now(), self.wait_s
        lost = []
        timed_out = False
        for tag, sent in list(self._flying.items()):
            if sent.order + _LATER <= self._newest:
                lost.append((tag, sent))
            elif now - sent.at >= wait:
                lost.append((tag, sent))
                timed_out = True
            else:
                break  # the later ones were sent later
        for tag, sent in lost:
            self._give_up(tag)
            if sent.order > self._cut:  # once for all requests that were in flight
                self.window = max(1.0, self.window / 2)
                self._cut = self._order
        if timed_out:
            self._backed_off *= 2
        return [sent for _, sent in lost]

    def settle(self, seconds: float) -> None:
        """Waits for late answers, and counts every request without an answer as lost."""
        self.begin()
        if self._left or self._given_up:
            self.listen(seconds)
        self.counts.lost += len(self._left)
        self._given_up |= self._left
        self._left.clear()

    def listen(self, seconds: float) -> None:
        """Takes what arrives within a time."""
        limit = Countdown(seconds, _LISTEN_S, self.port.now)
        while (left := limit.left()) > 0:
            data = self.port.receive(min(left, _LISTEN_S))
            answer = None if data is None else answered(data)
            if answer is not None:
                self._take(answer[0])

    def _take(self, tag: int) -> Sent | None:
        """The request with this tag, if this is its first answer."""
        counts = self.counts
        sent = self._flying.pop(tag, None) or self._left.pop(tag, None)
        if sent is None:
            sent = self._given_up.pop(tag, None)
            if sent is None:
                if tag in self._done:
                    counts.repeated += 1
                else:
                    counts.strange += 1
                return None
            counts.late += 1
            counts.lost -= 1
        now = self.port.now()
        counts.answered += 1
        if sent.order < self._newest:
            counts.reordered += 1
        else:
            self._newest = sent.order
        self._silence.restart()
        self._backed_off = 1.0
        self._measure(now - sent.at)
        self.window = min(_MOST_WINDOW, self.window + 1 / self.window)
        _remember(self._done, tag, None)
        return sent

    def _measure(self, seconds: float) -> None:
        if self.round_trip_s is None:
            self.round_trip_s, self._variation_s = seconds, seconds / 2
            return
        self._variation_s += _VARIATION_GAIN * (
            abs(seconds - self.round_trip_s) - self._variation_s
        )
        self.round_trip_s += _GAIN * (seconds - self.round_trip_s)

    def _give_up(self, tag: int) -> None:
        _remember(self._given_up, tag, self._flying.pop(tag))
        self.counts.lost += 1

    def _check_silence(self) -> None:
        over = self._silence.left() <= 0
        silence = self._silence.spent
        if self.port.refused and silence > _FIRST_WAIT * self.patience_s:
            raise LineFault(
                Cause.SILENT, f"no program listens at {self.port.name}",
                "name the port of the board, or start `viform board virtual --udp HOST`",
            )  # fmt: skip
        if over:
            raise silent(self.port, silence, self.counts.answered > 0)


def is_answered(exchange: Exchange, make: Callable[[int], bytes], tries: int = 6) -> bool:
    """Whether one of several equal requests is answered.

    Raises LineFault GONE.

    Args:
        exchange: exchange that sends them, one at a time.
        make: returns the packet for a tag.
        tries: most packets that may be lost.
    """
    exchange.least_wait_s = _DOUBTFUL_WAIT_S
    try:
        for _ in range(tries):
            exchange.begin()  # waits no longer for each than for the first
            exchange.send(0, make)
            while True:
                if exchange.receive() is not None:
                    return True
                if exchange.overdue():
                    break
    except LineFault as fault:
        if fault.cause is not Cause.SILENT:
            raise
    finally:
        exchange.least_wait_s = _LEAST_WAIT_S
    return False


def silent(port: PacketPort, seconds: float, answered_before: bool) -> LineFault:
    """The fault of a board that does not answer."""
    if answered_before:
        return LineFault(
            Cause.SILENT,
            f"no answer from {port.name} for {seconds:.2g} s, though the board answered before",
            "check its power, its link and the cable",
        )
    local = (
        ""
        if port.same_port or ":127." in port.name
        else ", and end the program that uses the same UDP port here, to which LiteEth answers"
    )
    return LineFault(
        Cause.SILENT,
        f"no answer from {port.name} within {seconds:.2g} s",
        "check the board's power and link, its IP address and port, that both are on one network, "
        f"and the firewall{local}",
    )


def _remember(known: dict[int, Kept], tag: int, what: Kept) -> None:
    known[tag] = what
    if len(known) > _REMEMBERED:
        del known[next(iter(known))]
