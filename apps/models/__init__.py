"""Models and scenes that are made here or loaded: the samples, the demo's, people's own files."""
