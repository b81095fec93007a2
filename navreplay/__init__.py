"""The core: timeline, filters and what they stand on, in arrays. Uses numpy, scipy and numba, and no file format.

A newcomer looks in `filters/run.py` for the epoch loop and in `filters/presets.py` for the methods by name.
"""
