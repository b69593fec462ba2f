"""Lessons of the contact lab as HTML pages: one file a lesson, without a server and without a network."""
