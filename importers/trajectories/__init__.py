"""Trajectories as other programs write them: SBET and GPX. Uses rows; another such format is read here."""
