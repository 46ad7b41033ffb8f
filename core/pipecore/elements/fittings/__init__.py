"""Fittings between straights: bends, reducers, flanges, tees, what follows open ends."""
