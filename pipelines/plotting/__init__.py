"""Plots as SVG: scales, lines, bands, skies. Uses the core; a new kind of plot is a file here."""
