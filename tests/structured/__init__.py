"""Generated files of models: valid ones of known geometry in many written forms, and broken ones.

``FORMATS`` maps the name of a format to a function from a random generator to a `StructuredFile`. A format adds
itself by a line in `tests.structured.formats`.
"""
