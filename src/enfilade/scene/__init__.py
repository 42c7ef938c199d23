"""Renderers behind the seam of ``renderer.Renderer``: one module each."""
