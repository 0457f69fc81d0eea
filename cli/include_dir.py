"""`brrt include-dir`: where the C++ headers are, for compilers and CMake."""

import typer

from .console import print_line


def include_dir(
    cmake_dir: bool = typer.Option(
        False, "--cmake-dir", help="Print the folder of the CMake package instead."
    ),
) -> None:
    """Print the folder of the C++ headers, which record planners in C++.

    Examples:
      g++ -std=c++17 -pthread -I"$(brrt include-dir)" planner.cpp
      cmake -S . -B build -Dbrrt_DIR="$(brrt include-dir --cmake-dir)"
    """
    from importlib.resources import files

    print_line(str(files("brrt") / ("cmake" if cmake_dir else "include")))
