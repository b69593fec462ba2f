"""Sample models, the scenes of the demo, and loading of models and definitions."""
