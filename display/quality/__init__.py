"""Display quality: pure functions of light waveforms, edge profiles and images."""
