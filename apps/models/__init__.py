"""Sample models, and loading of the models and definitions that a command line names."""
