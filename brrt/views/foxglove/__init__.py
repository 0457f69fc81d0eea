"""Runs as Foxglove and Lichtblick draw them."""
