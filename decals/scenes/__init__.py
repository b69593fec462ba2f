"""What a picture shows: objects, decals, images and camera, and their files."""
