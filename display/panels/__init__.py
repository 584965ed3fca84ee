"""Parameters of panels: spike-continuous, frame, and binary-plane panels."""
