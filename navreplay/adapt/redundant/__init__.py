"""R from redundant measurements: differences against the INS and the window functions beneath them (Ge et al. 2020). A
method of that kind is a file here.
"""
