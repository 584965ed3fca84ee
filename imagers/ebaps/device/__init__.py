"""The imager itself: sequencer, drive, exposure loop, dark frames, registers."""
