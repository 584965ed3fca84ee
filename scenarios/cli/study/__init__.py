"""Commands of studies: bench, compare, laboratory, paper, stability."""
