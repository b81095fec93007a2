"""Where satellites are: ephemerides, Kepler, GLONASS and precise orbits, rotation during the flight of a signal. Uses rows; a
new kind of orbit is a file here.
"""
