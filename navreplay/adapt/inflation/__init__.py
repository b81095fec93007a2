"""The prior widened instead of R: strong tracking, H-infinity, partial tracking. A method of that kind is a file here."""
