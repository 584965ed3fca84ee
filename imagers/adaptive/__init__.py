"""The adaptive-exposure CMOS sensor: statistics, decision, double reset counters, registers."""
