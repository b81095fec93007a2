"""The Earth, rotations, time scales and the launch frame: pure functions of arrays. Uses nothing but the types of
`navreplay.timeline`; a new frame or time scale is a file here.
"""
