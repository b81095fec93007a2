"""Moment rules: how the moments of a prediction are formed from those of the state, and what a measurement does to them. Uses
error_models, update and what lies below; a new rule is a file here and a line in `filters/presets.py`.
"""
