"""The commands, one file each, and their shared options, help texts and progress bars."""
