"""brrt's plugin for pytest: golden runs and gates, as the fixtures `brrt_golden` and `brrt_gate`.

Every pytest session in an environment with brrt loads this package. It is therefore separate from
the library and imports it only when a test uses a fixture.
"""
