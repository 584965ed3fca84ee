"""From a file or a stream of packets to the planes of a panel."""

from link.sending.transmission import FileTransmission, PlaneStream, Transmission

__all__ = ["FileTransmission", "PlaneStream", "Transmission"]
