"""RINEX observations and navigation, and SP3. Uses text and satellites; a new version of the standard is read here."""
