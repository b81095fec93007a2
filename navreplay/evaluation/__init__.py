"""What a solution is worth: errors against a reference, outages, consistency, satellites in view. Uses solution, geodesy and
measurements; a new figure of merit goes here.
"""
