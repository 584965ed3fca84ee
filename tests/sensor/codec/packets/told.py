"""What packets of the code `event` tell of their gaps."""

from __future__ import annotations

import numpy as np

from sensor.codec.packets.event import Gap


def gaps_of(data: bytes, cycles: int) -> list[Gap]:
    """The gaps of a packet."""
    marks = [
        (int(h) >> 7 & 127, int(h) & 127) for h in np.frombuffer(data, "<u2") if int(h) >> 14 == 1
    ]
    ends = [*marks[1::2], (cycles, 0)]
    return [Gap(*mark, *end) for mark, end in zip(marks[::2], ends, strict=False)]
