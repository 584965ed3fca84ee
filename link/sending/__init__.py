"""From a file to the planes of a panel."""

from link.sending.stream import PlaneStream
from link.sending.transmission import Transmission

__all__ = ["PlaneStream", "Transmission"]
