"""Files and folders written whole or not at all. Uses nothing of ours."""
