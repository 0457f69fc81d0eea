"""Folds over events: the forest, the figures, the first difference."""
