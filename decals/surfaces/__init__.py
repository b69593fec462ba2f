"""What decals lie on: meshes and implicit surfaces under one protocol, on any device."""
