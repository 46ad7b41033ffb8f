"""The project file: its format, and references to the clouds."""
