"""Noise from the innovations of a window or a fading mean: IAE, Sage-Husa. A method of that kind is a file here."""
