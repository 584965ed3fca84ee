"""What an imager provides: its device, section, model, and side of the comparison."""
