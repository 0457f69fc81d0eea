"""MCAP: reader and writer."""
