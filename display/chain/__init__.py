"""The display in the chain of a run: its stages, what observers receive, and its outcome."""
