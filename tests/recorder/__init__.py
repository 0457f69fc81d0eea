"""Recording planners that are not brrt's own."""
