"""What sensors measure, as residual, Jacobian and noise: fixes, attitudes, ranges, standstill. Uses error models for the
state's layout; a new kind of measurement is a file here and its epochs a file in `aiding`.
"""
