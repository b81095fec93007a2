"""The configuration: sections with units and defaults, validation, the commented template. Uses the core's options; a new key
is a field of its section.
"""
