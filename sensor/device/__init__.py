"""What belongs to one chip: presets, faults, fixed pattern, cross-talk."""
