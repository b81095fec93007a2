"""The solution as files: solution.csv, exports, another point of the vehicle. Uses files; a new export format is a function
in `export.py`.
"""
