"""Tests of brrt."""
