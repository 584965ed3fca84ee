"""The receiver: it locates the panel, times its symbols, tracks them and decodes the file."""

from link.receiving.received import Received
from link.receiving.receiver import Receiver

__all__ = ["Received", "Receiver"]
