"""Streams of Septentrio receivers (SBF). Uses receivers, decoding and rows; a further block is read here."""
