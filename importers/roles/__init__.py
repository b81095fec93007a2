"""What a channel means to navigation: which types of message are IMU, fix, range or reference, and which channel is chosen.
Uses all readers below; the meaning of a new message type is an entry in `messages.py` or beside it.
"""
