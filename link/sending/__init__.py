"""From a file to the planes that a panel shows."""

from link.sending.stream import PlaneStream
from link.sending.tags import Tag, draw_tags
from link.sending.transmission import Transmission

__all__ = ["PlaneStream", "Tag", "Transmission", "draw_tags"]
