"""What of a run is drawn in Rerun: trees, paths, cells, moves."""
