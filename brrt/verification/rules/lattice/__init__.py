"""Rules about searches on a lattice and about robots that move on it."""
