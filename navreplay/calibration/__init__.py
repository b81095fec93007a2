"""Noise and settings found in the whole log before the run that counts: the log made linear, expectation maximisation, `auto`.
Uses adapt and error models; a new way to learn from the whole log is a file here, named in a preset.
"""
