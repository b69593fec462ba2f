"""Generated files of models: valid ones of known geometry in many written forms, and broken ones.

`tests.structured.formats` maps the name of each format to a function from a random generator to a
`StructuredFile`.
"""
