"""Rerun's file format: the reader; its writer is the sink in brrt.views.rerun."""
