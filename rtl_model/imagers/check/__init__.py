"""The check of a plan: errors of pixel values, and of the decisions of the controller."""
