"""Generators of worlds: what is scattered, cells and ways, walls, and scenes; see GENERATORS."""
