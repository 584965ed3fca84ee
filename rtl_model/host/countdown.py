"""A time limit that an interruption of the host does not use up.

The system may suspend the host, and a simulated board with it, for longer than any limit. The board
could not answer in that time, so it does not count.
"""

from __future__ import annotations

import time
from collections.abc import Callable


class Countdown:
    """Time that is left of a limit. Whoever waits must look at it again and again.

    Args:
        seconds: the limit, s.
        longest_s: most that counts from one look to the next, s; longer than the waits between.
        now: clock, s.

    Attributes:
        spent: time that counts so far, s.
    """

    def __init__(
        self, seconds: float, longest_s: float, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._seconds, self._longest_s, self._now = seconds, longest_s, now
        self.restart()

    def restart(self) -> None:
        """Begins again with the whole limit."""
        self.spent, self._looked = 0.0, self._now()

    def left(self) -> float:
        """Looks: the time that is left, s; 0 or less when it is over."""
        now = self._now()
        self.spent += min(now - self._looked, self._longest_s)
        self._looked = now
        return self._seconds - self.spent
