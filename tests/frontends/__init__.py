"""Doors to our pictures: Qt windows, browsers, notebooks. What they need is optional."""
