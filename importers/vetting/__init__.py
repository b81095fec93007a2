"""What a log says of itself is compared before any filtering, and what is proven wrong is turned, moved or left out, and told.

Uses the core, findings and the match of motions in preflight; a new comparison is a file here, called from `vet.py`. Each takes
the fixes (`axes.py` the IMU) and returns those to use.
"""
