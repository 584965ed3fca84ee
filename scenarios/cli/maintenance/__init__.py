"""Commands of the installation and of the source: doctor and test."""
