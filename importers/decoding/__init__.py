"""Bytes of messages into columns: fixed layouts, ROS, protobuf and JSON, and the definitions of types. Uses rows; a new
encoding of messages is a file here.
"""
