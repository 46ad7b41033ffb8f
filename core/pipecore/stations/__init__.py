"""Stations checked by their own pipes: corrections, what cannot be told, and moved clouds."""

from pipecore.stations.check import check_stations

__all__ = ["check_stations"]
