"""Tests of the exports as tables and graphs."""
