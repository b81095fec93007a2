"""Many drives at once: which files are a drive, who processes it, what of it is done, and what came of all of them.

`sources` finds the drives. Uses outputs and everything below; nothing but the commands uses it. A new way to run jobs is a
class in `executors.py`, a new column of the catalogue a line in `pipelines/drive/headline.py`.
"""
