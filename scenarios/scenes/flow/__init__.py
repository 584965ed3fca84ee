"""The start of a hypersonic wind tunnel, seen through a schlieren bench."""
