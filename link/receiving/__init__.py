"""From spikes to a file: find the panel, time it, follow it, decode it."""

from link.receiving.received import Instant, Received
from link.receiving.receiver import Receiver

__all__ = ["Instant", "Received", "Receiver"]
