"""Rules by subject: each file holds the rules about one part of a run."""
