"""From log files to results: configuration, one drive, report, recording, experiments, and the command line over them."""
