"""What planners share, compiled: events, clock, nearest neighbours, broad phase, spaces."""
