"""Streams of NovAtel OEM and Septentrio receivers. Uses decoding and rows; a further message is read here."""
