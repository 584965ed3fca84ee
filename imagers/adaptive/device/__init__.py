"""The sensor itself: timing, sequencer, exposure selection, registers."""
