"""Noise of greatest likelihood or by its posterior: ML, EM, variational Bayes. A method of that kind is a file here."""
