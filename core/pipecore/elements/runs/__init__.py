"""Runs: elements whose ends meet, and straights that are one pipe."""
