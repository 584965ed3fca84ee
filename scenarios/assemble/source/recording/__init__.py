"""A recorded stream in the place of a chip: opened, recorded into the run's folder, imaged."""
