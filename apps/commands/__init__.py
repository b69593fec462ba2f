"""The commands, one file each, and what they share: options, help, progress bars."""
