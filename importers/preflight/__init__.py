"""Checks of a timeline before any filtering, each a plain sentence with cause and cure. Uses the core and satellites; a new
check is a function here, called from `checks.py`.
"""
