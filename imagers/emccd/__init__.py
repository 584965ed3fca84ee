"""Frame-transfer EMCCD of seed 003 as a whole machine: timing, sequencer, registers, cooling."""
