"""Drawing of analytic scenes."""
