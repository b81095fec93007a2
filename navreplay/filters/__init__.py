"""The epoch loop and what drives it: presets, banks, consider parameters, smoothing, rows of the solution. Uses
every room of the core but evaluation; a new combinator is a file here and a line in `presets.py`.
"""
