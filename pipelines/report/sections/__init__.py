"""Sections of a report, a file each: what of a run they show, as plots and tables. Uses the report's tables and plotting; a new
section is a file here, called in `figures.py` and `tables.py`.
"""
