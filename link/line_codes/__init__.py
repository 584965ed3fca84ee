"""Line codes along time, on the symbols of each cell, that limit runs of equal symbols."""

from link.line_codes.catalogue import CATALOGUE, decode_line, encode_line

__all__ = ["CATALOGUE", "decode_line", "encode_line"]
