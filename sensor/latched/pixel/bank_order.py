"""An order of numbers without correlation between those a few places apart."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy", nogil=True)
def _sums(x, sums):  # type: ignore[no-untyped-def]
    """Sums of the products of entries 1 to sums.size apart, around the end; in place."""
    for lag in range(1, sums.size + 1):
        sums[lag - 1] = 0
        for i in range(x.size):
            sums[lag - 1] += x[i] * x[(i + lag) % x.size]


@njit(cache=True, error_model="numpy", nogil=True)
def _exchange(x, sums, i, j, moved):  # type: ignore[no-untyped-def]
    """Writes to `moved` the sums after entries i and j of x are exchanged."""
    n, change = x.size, x[j] - x[i]
    for lag in range(1, sums.size + 1):
        after = x[(i + lag) % n] + x[(i - lag) % n] - x[(j + lag) % n] - x[(j - lag) % n]
        # The product of both entries stays as it is.
        near = (i - j) % n == lag or (j - i) % n == lag
        moved[lag - 1] = sums[lag - 1] + change * (after - (change if near else 0))


@njit(cache=True, error_model="numpy", nogil=True)
def uncorrelate(x, place, sums, limit, trials):  # type: ignore[no-untyped-def]
    """Exchanges entries until the sum of products at every lag is at most `limit`.

    Entries of similar size are exchanged, the more similar the smaller the sums are, as one
    exchange changes all sums together.

    Args:
        x: (n,) int64, entries about their mean; in place.
        place: (n,) int64, place in x of the entries in ascending order; in place.
        sums: (lags,) int64, an output.
        limit: largest sum.
        trials: most exchanges that are tried.

    Returns:
        Number of exchanges tried.
    """
    n = x.size
    moved = np.empty(sums.size, np.int64)
    _sums(x, sums)
    state = np.uint64(0x9E3779B97F4A7C15)
    total = 0.0
    for s in sums:
        total += float(s) * float(s)
    whole = 0.0
    for v in x:
        whole += float(v) * float(v)
    for trial in range(trials):
        worst = 0
        for s in sums:
            worst = max(worst, abs(s))
        if worst <= limit:
            return trial
        state = state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
        rank = np.int64(state >> np.uint64(33)) % n
        state = state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
        # An exchange of entries a spread apart changes a sum by some units of whole / n.
        reach = np.int64(min(max(float(n) * float(n) * worst / whole, 2.0), n // 2))
        other = (rank + 1 + np.int64(state >> np.uint64(33)) % reach) % n
        i, j = place[rank], place[other]
        _exchange(x, sums, i, j, moved)
        square = 0.0
        for s in moved:
            square += float(s) * float(s)
        if square < total:
            total = square
            for lag in range(sums.size):
                sums[lag] = moved[lag]
            x[i], x[j] = x[j], x[i]
            place[rank], place[other] = j, i
    return trials
