"""Logs as strangers make them: tables, messages and sentences with faults of the field, judged as `tests.field.promise` does.

`files.py` writes them, `tables.py` and `messages.py` hold the kinds, each a function that writes a log into a folder;
`judge.py` runs inspect, init and run on one.
"""
