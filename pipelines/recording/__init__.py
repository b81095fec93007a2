"""The recording for the Rerun viewer: layout, series, map, sky. Uses report and plotting; a new view is a file here."""

import os

os.environ.setdefault("RUST_LOG", "off")  # what goes wrong is told in one line of ours, not in its own log as well
