"""What this machine has, and how to start on it."""
