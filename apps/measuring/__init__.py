"""What measurements need: even coats in seconds, and the paper's own numbers."""
