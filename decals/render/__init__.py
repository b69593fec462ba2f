"""Pictures of scenes through OpenGL."""
