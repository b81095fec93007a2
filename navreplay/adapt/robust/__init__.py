"""Outliers weighted down: Huber, Student's t, correntropy. A method of that kind is a file here."""
