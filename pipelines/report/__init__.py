"""The report of a run or a comparison: content, tables, figures, HTML and Markdown. Uses drive and plotting; a new section
is a function in `tables.py` or `figures.py`.
"""
