"""The board under test: its port and endpoint, records of a stage, and faults of its line."""
