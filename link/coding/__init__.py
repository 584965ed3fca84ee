"""Bytes to bits and back: CRC, Reed-Solomon, interleaver, line codes, fountain, frames."""
