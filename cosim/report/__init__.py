"""Components of report pages: HTML, pictures and figures."""
