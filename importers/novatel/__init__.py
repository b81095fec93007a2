"""Streams of NovAtel OEM receivers, binary and ASCII. Uses receivers, decoding and rows; a further message is read here."""
