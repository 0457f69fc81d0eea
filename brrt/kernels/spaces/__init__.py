"""Configuration spaces of robots as kernels see them."""
