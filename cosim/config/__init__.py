"""Configuration: quantities with units, the base of every section."""
