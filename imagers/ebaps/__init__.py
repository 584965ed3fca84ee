"""The EBAPS imaging circuit: timing, exposure loop, dark subtraction, registers, whole imager."""
