"""OpenCL, counter-based random numbers, and the check of free memory."""
