"""Rules about searches on a lattice."""
