"""Rows into series in our axes, units and time, a file per series. Uses roles; a new assumption on inputs is made (and told)
here.
"""
