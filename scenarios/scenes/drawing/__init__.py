"""What analytic scenes are drawn with."""
