"""One drive from log files to a result: read, check, withhold, filter, evaluate; and the same drive by several methods. Uses
importers, core, config and trajectory.
"""
