"""Runs as data for other programs: tables and graphs, at any instant."""
