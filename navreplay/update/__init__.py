"""One epoch's arithmetic: innovation, conditioning, gates, the protocol of noise adapters, and the record of what happened.
Uses timeline, options and solution; it knows no state layout. A new gate goes here.
"""
