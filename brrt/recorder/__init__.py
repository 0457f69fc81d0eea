"""Record planners that are not brrt's own: `brrt.record`, and `brrt.log` for libraries."""
