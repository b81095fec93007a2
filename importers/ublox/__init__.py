"""u-blox streams and the measurements in them. Uses containers' bytes and rows; a new UBX message is read here."""
