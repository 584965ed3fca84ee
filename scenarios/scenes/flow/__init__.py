"""The start of a hypersonic wind tunnel, imaged by a schlieren bench."""
