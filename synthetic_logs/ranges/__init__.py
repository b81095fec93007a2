"""Raw ranges: constellation, sight, surroundings, receiver and its clock. Uses sensors; a new disturbance is a file here."""
