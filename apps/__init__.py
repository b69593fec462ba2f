"""Applications: the command line, its commands, the sample models and the gallery."""
