"""The recording for the Rerun viewer: layout, series, map, sky. Uses report and plotting; a new view is a file here."""
