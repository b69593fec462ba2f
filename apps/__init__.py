"""What people start: the command line, its commands and the samples."""
