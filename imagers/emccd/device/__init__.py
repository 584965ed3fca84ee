"""The camera itself: timing, sequencer, registers, cooling."""
