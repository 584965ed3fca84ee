"""From a file to the planes that a panel shows."""

from link.sending.stream import PlaneStream
from link.sending.transmission import Transmission

__all__ = ["PlaneStream", "Transmission"]
