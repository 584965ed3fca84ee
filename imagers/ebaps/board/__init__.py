"""The board behind the imager: timing, memory with its bus and FIFOs, Camera Link."""
