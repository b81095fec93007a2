"""Files that hold messages of many channels: MCAP, ROS 1 and ROS 2 bags, and their records and compression. Uses decoding; a
new container is a file here and a line in `importers/formats.py`.
"""
