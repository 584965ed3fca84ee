"""A scenario: its schema, its messages, and how it is loaded."""
