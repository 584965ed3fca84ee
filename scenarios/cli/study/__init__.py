"""Commands of studies: bench, calibrate, compare, laboratory, paper, stability."""
