"""What the devices of all imagers share: registers, their bus, and traces of signals."""
