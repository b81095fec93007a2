"""NMEA 0183: sentences as they are found in files and streams, and the fixes that they make. Uses rows and text."""
