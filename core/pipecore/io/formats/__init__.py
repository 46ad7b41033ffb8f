"""Formats that can be read: one module each, one contract for all (`pipecore.io.source`)."""
