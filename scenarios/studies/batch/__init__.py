"""Many runs in one folder: the values of their keys, their workers, and what is left to do."""
