"""brrt's plugin for pytest: golden runs and gates, as the fixtures `brrt_golden` and `brrt_gate`.

Whoever runs pytest where brrt is installed loads this package. So it stands beside brrt, not in it,
and imports brrt when a test first calls a fixture and not before.

PYTEST_DONT_REWRITE: there is nothing to rewrite here, and whoever imported it is not to be warned.
"""
