"""The check of a plan: errors of pixel values, and of the decisions of an imager's controller."""
