"""Error states: layout, names, units, retraction and propagation, a file per model. Uses mechanisation and update; a new
error model is a file here that keeps the protocol of `error_model.py`.
"""
