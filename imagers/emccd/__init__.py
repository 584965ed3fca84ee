"""Frame-transfer EMCCD of document 003 as a machine: timing, sequencer, registers, cooling."""
