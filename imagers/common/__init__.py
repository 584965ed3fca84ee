"""What the imagers share: their interface, registers, traces, and the light on their plane."""
