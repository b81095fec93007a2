"""Tables and sentences: CSV by a mapping, NMEA, RTKLIB positions, KF-GINS, TUM. Uses rows; a new text format is a file here
and a line in `importers/formats.py`.
"""
