"""What tables hold that nobody described: mappings drafted from names, units and values, each with its reasons.

Uses text and what stands below it; a name or a mark of another logger belongs into `importers/rows/field_names.py`, a way of
telling columns by value into `headerless.py`.
"""
