"""The clock of a camera that is locked to the panel's planes, before a run and over it."""
