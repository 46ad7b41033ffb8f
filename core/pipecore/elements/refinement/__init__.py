"""Refinement: a robust geometric fit of each proposal to the full-resolution points around it."""
