"""What this machine has of what the project needs, finding by finding, and how to start Warp on it."""
