"""Plots as PNG bytes, and the browser viewer."""
