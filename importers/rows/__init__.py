"""What every reader delivers: tables of rows with their counts, logs and channels, time bases, signals, screening. Uses the
core's timeline; a column that all readers share is named here.
"""
