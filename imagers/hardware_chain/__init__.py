"""The chain of document 004: sensor, circuit with its supply's ripple, converter, gains, tones."""
