"""The checks of the bring-up, one stage a file."""
