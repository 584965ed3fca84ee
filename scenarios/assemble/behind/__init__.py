"""What takes a stream, of any source, recorded or live: readout, link, display, board."""
