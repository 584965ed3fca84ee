"""What came of a transmission: errors, rates, delays, reach and capacity."""
