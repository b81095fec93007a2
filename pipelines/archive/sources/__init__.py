"""What an archive consists of: its files, what each of them holds, which of them are one drive, and the rules that settle it.

Uses importers, config and files. A new kind of source is a branch in `listing.py`.
"""
