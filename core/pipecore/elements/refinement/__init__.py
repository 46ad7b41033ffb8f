"""Refinement: a robust geometric fit of each piece to the full-resolution points around it."""
