"""The shared channel: queueing theory's closed forms, the arbiters' orders, nothing unaccounted."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from sensor.asynchronous.model import Firings
from sensor.asynchronous.readout.channel import Channel, ChannelModel, Sent

SHAPE = (64, 64)
SERVICE = 10_000
END = 2**60


def firings(instant: npt.ArrayLike, pixel: npt.ArrayLike) -> Firings:
    n = len(np.asarray(instant))
    ones = np.ones(n, np.int64)
    return Firings(
        np.asarray(pixel, np.uint32), np.asarray(instant, np.int64), ones, ones.astype(float),
        ones.astype(np.uint16),
    )  # fmt: skip


def poisson_traffic(load: float, n: int = 200_000) -> Firings:
    """Firings at a mean rate of load / SERVICE, of pixels drawn evenly."""
    rng = np.random.default_rng(1)
    instant = np.cumsum(rng.exponential(SERVICE / load, n))
    return firings(np.ceil(instant), rng.integers(0, SHAPE[0] * SHAPE[1], n))


def send(asking: Firings, shape: tuple[int, int] = SHAPE, **more: Any) -> tuple[Channel, Sent]:
    channel = Channel(ChannelModel(SERVICE, **more), shape)
    return channel, channel.step(asking, END)


@pytest.mark.parametrize("load", [0.2, 0.5, 0.8])
def test_the_mean_wait_is_pollaczek_and_khinchine_s(load):
    """M/D/1: W = rho / (2 mu (1 - rho)) (Kleinrock, Queueing Systems 1, 1975, eq. 5.72)."""
    channel, sent = send(poisson_traffic(load), buffer="fifo", depth=10**6)
    wait = (sent.delay - SERVICE) / SERVICE
    theory = load / (2 * (1 - load))
    # Waits are correlated over a busy period; 100 batches of 2000 give an honest standard error.
    batches = wait.reshape(100, -1).mean(axis=1)
    assert wait.mean() == pytest.approx(theory, abs=4.9 * batches.std(ddof=1) / 10)
    assert batches.std(ddof=1) / 10 < 0.05 * theory
    assert channel.lost == 0


@pytest.mark.parametrize("load", [0.2, 0.7, 2.0])
def test_without_a_waiting_place_the_loss_is_erlang_s(load):
    """M/D/1/1: Erlang B, rho / (1 + rho), whatever the law of the service."""
    channel, sent = send(poisson_traffic(load), buffer="fifo", depth=0)
    p = load / (1 + load)
    # Losses within one service time go together, so their variance is at most 1 + 2 load times
    # the binomial's.
    error = np.sqrt(p * (1 - p) / channel.offered * (1 + 2 * load))
    assert channel.lost / channel.offered == pytest.approx(p, abs=4.9 * error)
    assert (sent.delay == SERVICE).all()


@pytest.mark.parametrize(
    "more",
    [
        {"arbitration": "fifo", "buffer": "fifo", "depth": 3},
        {"arbitration": "fifo", "buffer": "pixel"},
        {"arbitration": "priority", "buffer": "pixel"},
        {"arbitration": "round-robin", "buffer": "row"},
        {"arbitration": "fifo", "buffer": "row"},
    ],
)
def test_everything_is_carried_lost_or_waiting_however_the_run_is_split(more):
    asking = poisson_traffic(0.95, 5000)
    whole, sent = send(asking, **more)
    assert whole.offered == len(sent.leaves) + whole.lost + whole.waiting == 5000
    assert whole.waiting == 0
    # One at a time, none before it fired.
    starts = sent.leaves - SERVICE
    assert (np.diff(starts) >= SERVICE).all() and (sent.delay >= SERVICE).all()
    split = Channel(ChannelModel(SERVICE, **more), SHAPE)
    rng = np.random.default_rng(2)
    cuts = [0, *sorted(rng.integers(1, int(asking.instant[-1]), 40).tolist()), END]
    parts = []
    for a, b in pairwise(cuts):
        parts.append(split.step(asking.take((asking.instant > a) & (asking.instant <= b)), b))
        assert split.offered == sum(len(p.leaves) for p in parts) + split.lost + split.waiting
    for name in ("pixel", "instant"):
        joined = np.concatenate([getattr(p.firings, name) for p in parts])
        assert np.array_equal(joined, getattr(sent.firings, name))
    assert np.array_equal(np.concatenate([p.leaves for p in parts]), sent.leaves)
    assert split.lost == whole.lost


@pytest.mark.parametrize(
    ("arbitration", "order"),
    [
        ("fifo", [21, 2, 9, 11, 0, 20]),
        ("priority", [2, 0, 9, 11, 20, 21]),
        ("round-robin", [2, 11, 20, 0, 21, 9]),
    ],
)
def test_arbiters_grant_in_their_own_order(arbitration, order):
    """A 3 x 10 array; 2, 9, 11, 0, 20 ask while the first is on the bus. At the very first instant
    21 and 2 ask together: the row above wins, but for the oldest first, where order of asking does.
    """
    asking = firings([100, 100, 101, 102, 103, 104], [21, 2, 9, 11, 0, 20])
    _, sent = send(asking, (3, 10), arbitration=arbitration)
    assert sent.firings.pixel.tolist() == order
    assert sent.leaves.tolist() == [100 + SERVICE * k for k in range(1, 7)]


def test_a_place_that_is_taken_loses_the_next_event():
    asking = firings([100, 101, 102, 103, 104], [5, 7, 7, 17, 8])
    for buffer, lost, through in (("pixel", 1, [5, 7, 8, 17]), ("row", 2, [5, 7, 17])):
        channel, sent = send(asking, (2, 10), arbitration="priority", buffer=buffer)
        assert channel.lost == lost
        assert sent.firings.pixel.tolist() == through


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="served in order"):
        ChannelModel(1000, "priority", "fifo")
    with pytest.raises(ValueError, match="service"):
        ChannelModel(0)
