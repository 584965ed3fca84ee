"""From spikes to a file: find the panel, time it, follow it, decode it."""

from link.receiving.received import Received
from link.receiving.receiver import Receiver

__all__ = ["Received", "Receiver"]
