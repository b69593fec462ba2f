"""The tables: every formula once, as a typed function, and which rows the codes on a tape stand for."""
