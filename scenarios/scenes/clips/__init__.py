"""Video clips and images as scenes."""
