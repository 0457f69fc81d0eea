"""Loaders: one file a format; the registry is `brrt.worlds.LOADERS`."""
