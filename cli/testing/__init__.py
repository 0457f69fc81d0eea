"""brrt's plugin for pytest: golden runs and gates, as the fixtures `brrt_golden` and `brrt_gate`.

Whoever runs pytest where brrt is installed loads this package. So it stands beside the library, not
in it, and imports it when a test first calls a fixture and not before.
"""
