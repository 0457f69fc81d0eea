"""The parts of a drawing in Rerun: trees, cells, paths, plots and what they share."""
