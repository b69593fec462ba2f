"""What measurements need: even coats in seconds, and the paper's figure 14 with its own numbers."""
