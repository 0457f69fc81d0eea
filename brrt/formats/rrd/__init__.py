"""Rerun's file format: events as Arrow columns, and the reader. The writer is brrt.views.rerun."""
