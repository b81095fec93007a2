"""Measurements by epoch, as the epoch loop asks for them, a file per kind of aiding. Uses measurements and start; a new aid
is a file here that keeps the protocol of `epochs.py`, chosen in `navreplay/aiding/guidance.py`.
"""
