"""OpenCL, counter-based random numbers, and free memory."""
