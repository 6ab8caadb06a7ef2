"""Bundled scenes, as data files."""
