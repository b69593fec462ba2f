"""The commands, one file each, and what they share: values of options and progress bars."""
