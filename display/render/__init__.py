"""Renderers: fragment shaders through EGL, and the golden model in numpy."""
