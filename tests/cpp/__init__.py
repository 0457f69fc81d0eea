"""The C++ headers, compiled and run."""
