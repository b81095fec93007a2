"""Words of navigation messages into ephemerides, a file per constellation. Uses satellites; a new message is decoded here."""
