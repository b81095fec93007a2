"""The state before the first epoch: levelling, heading, motion over ground, or what the user told. Uses measurements; a new
source of heading is a function in `heading.py`.
"""
