"""Display quality as pure functions of light waveforms, edge profiles and images."""
