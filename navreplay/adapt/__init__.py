"""Noise adapters: what R, Q or prior an epoch is updated with, a file per method in a room per idea. Uses update (and the
state's layout); a new adapter is a file in the room of its idea and a line in `navreplay/filters/presets.py`.
"""
