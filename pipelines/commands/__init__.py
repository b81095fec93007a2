"""The commands of the command line, one file each; `run(arguments)` does the work and prints."""
